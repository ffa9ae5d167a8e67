"""Simulated faults: parts, kinds, and their effects on commands and samples.

A broken sensor publishes NaN, as real ones do; every receiver's gate refuses it.
"""

from collections.abc import Callable, Mapping, Sequence
from math import nan
from typing import Literal, TypeVar

import msgspec

from messages.message import Message
from messages.simulator import FaultKind as Kind
from messages.simulator import FaultRequest
from messages.units import Finite
from services.marine.vehicle import Thruster, driven

OF_THRUSTERS = ("dead", "reversed", "weak", "stuck")
OF_SENSORS = ("silent", "frozen", "noisy", "biased", "broken")
# What some sensors can be instead: fit for a pilot to know of, though nothing is broken.
ALARMS: dict[str, tuple[Kind, ...]] = {
    "sensor/leak": ("wet",),
    "sensor/battery": ("low", "critical", "empty"),
    "sensor/temperature": ("hot",),
    "sensor/dvl": ("no_lock", "wrong_lock"),
}
CHARGES: dict[str, float] = {"low": 0.2, "critical": 0.08, "empty": 0.0}  # [-] left
HOT = 85.0  # [°C]
ALL = "all"  # stands for all parts, to clear all faults at once
# What `value` may be; the others take none.
LIMITS = {
    "weak": (0.0, 1.0),  # [-] share of the thrust
    "noisy": (0.0, 1000.0),  # [-] times the noise
    "biased": (-1e6, 1e6),  # in the sensor's unit
    "wrong_lock": (-5.0, 5.0),  # [m/s] of the fish, ahead
}
MEASURED: dict[str, tuple[str, ...]] = {
    "sensor/imu": ("angular_rate", "specific_force"),  # [rad/s], [m/s²]
    "sensor/magnetometer": ("field",),  # [T]
    "sensor/pressure": ("pressure",),  # [Pa]
    "sensor/dvl": ("velocity", "altitude"),  # [m/s], [m]
    "sensor/usbl": ("north", "east"),  # [m]
    "sensor/battery": ("voltage",),  # [V]
    "sensor/leak": (),  # neither noise nor bias
    "sensor/temperature": ("temperature",),  # [°C]
}
# The fields with the bias, where not all of them; they set its unit.
BIASED = {"sensor/imu": ("angular_rate",), "sensor/dvl": ("velocity",)}
S = TypeVar("S", bound=Message)


class Fault(msgspec.Struct, frozen=True):
    kind: Kind
    value: Finite = 0.0  # see LIMITS; of a stuck thruster [N], what it settles at

    def __str__(self) -> str:
        return f"{self.kind} {self.value:g}" if self.kind in LIMITS else self.kind


Faults = Mapping[str, Fault]  # in force, by part


Nearest = Callable[[str, Sequence[str]], str]  # (wrong name, known ones) → words that help


def refusal(
    request: FaultRequest, thrusters: Sequence[str], sensors: Sequence[str], nearest: Nearest
) -> str:
    """Why a vehicle with these parts cannot grant a request; empty when it can."""
    request = by_key(request, sensors)
    part, fault, value = request.part, request.fault, request.value
    parts = [*thrusters, *sensors, ALL]
    if part not in parts:
        return f"there is no part {part!r}{nearest(part, parts)}"
    possible = OF_THRUSTERS if part in thrusters else () if part == ALL else of_sensor(part)
    if fault not in ("none", *possible):
        return f"{part} cannot be {fault}; possible: {', '.join(('none', *possible))}"
    if fault not in LIMITS:
        return "" if value is None else f"{fault} takes no value"
    low, high = LIMITS[fault]
    if value is None or not low <= value <= high:
        return f"{fault} needs a value from {low:g} to {high:g}"
    return ""


def by_key(request: FaultRequest, sensors: Sequence[str]) -> FaultRequest:
    """A sensor may be called without `sensor/`: leak is sensor/leak."""
    key = f"sensor/{request.part}"
    return msgspec.structs.replace(request, part=key) if key in sensors else request


def in_words(request: FaultRequest) -> tuple[Literal["info", "warning"], str]:
    """What was done, for the log."""
    if request.fault == "none":
        return "info", f"mended: {request.part}"
    value = "" if request.value is None else f" {request.value:g}"
    return "warning", f"simulated fault: {request.part} {request.fault}{value}"


def of_sensor(key: str) -> tuple[str, ...]:
    """The faults that a sensor can have."""
    general = OF_SENSORS if MEASURED.get(key) else ("silent",)
    return (*general, *ALARMS.get(key, ()))


def changed(faults: Faults, request: FaultRequest, settles_at: float) -> dict[str, Fault]:
    """The faults in force after a request that was granted.

    Args:
        settles_at: [N] thrust of the part, if it is a thruster, to be stuck at.
    """
    if request.fault == "none":
        return {} if request.part == ALL else {p: f for p, f in faults.items() if p != request.part}
    value = settles_at if request.fault == "stuck" else request.value or 0.0
    return {**faults, request.part: Fault(request.fault, value)}


def settles_at(thruster: Thruster, command: float, fault: Fault) -> float:
    """[N] Thrust at which a thruster with this fault settles for a command."""
    match fault:
        case Fault(kind="dead"):
            return 0.0
        case Fault(kind="reversed"):
            return driven(thruster, -command)
        case Fault(kind="weak", value=share):
            return share * driven(thruster, command)
        case _:  # stuck
            return fault.value


def faulty(part: str, sample: S, fault: Fault, first: Message) -> S | None:
    """The sample with the fault applied; None when the sensor is silent.

    Args:
        first: its first sample since the fault began.
    """
    if fault.kind == "noisy" or fault.kind in ALARMS.get(part, ()):  # the sensor's model knows it
        return sample
    if fault.kind == "silent":
        return None
    fields = MEASURED[part]
    if fault.kind == "frozen":
        return msgspec.structs.replace(sample, **{name: getattr(first, name) for name in fields})
    off = nan if fault.kind == "broken" else fault.value
    fields = fields if fault.kind == "broken" else BIASED.get(part, fields)
    return msgspec.structs.replace(sample, **{n: _off(getattr(sample, n), off) for n in fields})


def _off(measured: float | tuple[float, ...] | None, by: float) -> float | tuple[float, ...] | None:
    """A number or a tuple of numbers, with an offset; of nothing measured nothing."""
    if measured is None:
        return None
    return tuple(x + by for x in measured) if isinstance(measured, tuple) else measured + by
