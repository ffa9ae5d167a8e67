"""Stick positions in MANUAL_CONTROL and RC_CHANNELS_OVERRIDE."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from services.mavlink_io.numbers import NO_AXIS, NO_CHANNEL
from services.piloting.sticks import Sticks

# [-] so close to the middle a stick counts as centred: pads of ground stations rest beside it, and
# the drone arms with centred sticks only.
DEAD_BAND = 0.03
HALF = 400.0  # [µs] from the middle of a channel to full stick
MIDDLE = 1500.0  # [µs]
DARK, RANGE = 1100.0, 800.0  # [µs] channel of the lights: off, and from there to full brightness
# ArduSub's channels, counted from 1 (ArduSub/radio.cpp).
HEAVE, YAW, SURGE, SWAY, TILT, LIGHT = 3, 4, 5, 6, 8, 9
READ = (HEAVE, YAW, SURGE, SWAY, TILT, LIGHT)


class StickPacket(NamedTuple):
    """What one packet says."""

    sticks: Sticks
    clipped: bool  # a value was beyond full stick
    light: float | None = None  # [-] 0 … 1; None: the packet has none


def manual_control(fields: Mapping[str, Any], gain: float) -> StickPacket:
    """x forward, y right, r clockwise: -1000 … 1000; z upwards: 0 … 1000 with 500 in the middle.
    An axis that is not there is centred.

    Args:
        gain: [-] command at full stick.
    """
    travels = [
        _travel(fields["x"], 0.0, 1000.0),
        _travel(fields["y"], 0.0, 1000.0),
        -_travel(fields["z"], 500.0, 500.0),
        _travel(fields["r"], 0.0, 1000.0),
    ]
    surge, sway, heave, yaw = (gain * _shaped(travel) for travel in travels)
    return StickPacket(Sticks(surge, sway, heave, yaw), any(abs(travel) > 1 for travel in travels))


def rc_override(fields: Mapping[str, Any]) -> StickPacket | None:
    """Channels 3 to 6, camera tilt on 8, lights on 9; 1100 … 1900 µs. A channel that is released
    (0) or not there (65535) is centred, unlike ArduSub's, which keeps its last value. None: all of
    them are, so nobody has the sticks."""
    told = {n: _channel(fields, n) for n in READ}
    if all(channel is None for channel in told.values()):
        return None
    travel = {n: 0.0 if us is None else (us - MIDDLE) / HALF for n, us in told.items()}
    sticks = Sticks(
        surge=_shaped(travel[SURGE]),
        sway=_shaped(travel[SWAY]),
        heave=-_shaped(travel[HEAVE]),
        yaw=_shaped(travel[YAW]),
        tilt=_shaped(travel[TILT]),
    )
    lamp = told[LIGHT]
    light = None if lamp is None else min(1.0, max(0.0, (lamp - DARK) / RANGE))
    clipped = any(abs(travel[n]) > 1 for n in READ)
    return StickPacket(sticks, clipped, light)


def _channel(fields: Mapping[str, Any], number: int) -> float | None:
    """[µs] None: released, or not there."""
    raw = fields[f"chan{number}_raw"]
    released = raw in (0, NO_CHANNEL) or (number > 8 and raw == NO_CHANNEL - 1)
    return None if released else float(raw)


def _travel(raw: int, middle: float, half: float) -> float:
    return 0.0 if raw == NO_AXIS else (raw - middle) / half


def _shaped(travel: float) -> float:
    """Clipped to ±1, 0 around the middle, and continuous."""
    beyond = (min(abs(travel), 1.0) - DEAD_BAND) / (1.0 - DEAD_BAND)
    return 0.0 if beyond <= 0.0 else beyond if travel > 0.0 else -beyond
