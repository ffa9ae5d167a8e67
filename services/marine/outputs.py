"""What a vehicle has beside thrusters and camera tilt: lights, lasers, a gripper.

A dimmer or switch is a state: it keeps its value, and the newest request sets it. A gripper is a
motion: it goes on only while commands say so, and stands still at once where they end.
"""

import re
from typing import Annotated, Literal

import msgspec

from messages.units import Outputs, WithinAnHour
from messages.vehicle import VehicleStatus

MOST_OUTPUTS = 16
LIGHT = "light"  # the output that requests of this kind, ground stations and the camera know
NAMED = re.compile(r"[a-z][a-z0-9_]{0,23}")
ServoNumber = Annotated[int, msgspec.Meta(ge=1, le=32)]
Pulse = Annotated[int, msgspec.Meta(ge=500, le=2500)]  # [µs]
OutputButton = Literal["light", "light_2", "laser"]
OutputKind = Literal["dimmer", "switch", "gripper"]


class Output(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One output of a vehicle file.

    Raises:
        ValueError: another name, or a gripper with `off_after`: it stands still at once.
    """

    name: str
    kind: OutputKind
    servo: ServoNumber | None = None  # [-] ArduSub: number of the output, for DO_SET_SERVO
    low: Pulse = 1100  # [µs] of 0; of a gripper that closes
    high: Pulse = 1900  # [µs] of 1; of a gripper that opens
    # [s] without a pilot until it goes off. It then is on only while the drone is armed. None: it
    # stays as it is, whatever becomes of the pilot.
    off_after: WithinAnHour | None = None

    def __post_init__(self) -> None:
        if not NAMED.fullmatch(self.name):
            raise ValueError(
                f"output {self.name!r}: expected a name of at most 24 small letters, digits and _, "
                f"with a letter first"
            )
        if self.kind == "gripper" and self.off_after is not None:
            raise ValueError(
                f"output {self.name}: a gripper takes no off_after, because it stands still at "
                f"once when the pilot is lost"
            )

    def pulse(self, value: float) -> int:
        """[µs] For a value 0 … 1; of a gripper -1 … 1, with its rest in the middle."""
        share = (value + 1.0) / 2.0 if self.kind == "gripper" else value
        return round(self.low + (self.high - self.low) * min(1.0, max(0.0, share)))


OUTPUTS = (Output(LIGHT, "dimmer"),)  # of a vehicle whose file names none


def checked(outputs: tuple[Output, ...], thrusters: int) -> None:
    """
    Args:
        thrusters: how many there are; ArduSub drives them by its outputs 1 to this number.

    Raises:
        ValueError: too many; two of one name, of one servo, or two grippers; a thruster's servo.
    """
    if len(outputs) > MOST_OUTPUTS:
        raise ValueError(f"there are {len(outputs)} outputs, allowed are at most {MOST_OUTPUTS}")
    names, servos = dict[str, int](), dict[int, str]()
    gripper = ""
    for number, output in enumerate(outputs, 1):
        if (first := names.setdefault(output.name, number)) < number:
            raise ValueError(
                f"output number {first} and output number {number} are both called "
                f"{output.name!r}, expected a name of its own for each"
            )
        if output.kind == "gripper":
            if gripper:
                raise ValueError(
                    f"outputs {gripper} and {output.name} are both grippers, allowed is one: a "
                    f"pilot's command moves one"
                )
            gripper = output.name
        if output.servo is None:
            continue
        if output.servo <= thrusters:
            raise ValueError(
                f"output {output.name}: servo {output.servo} drives a thruster, expected a number "
                f"from {thrusters + 1} to 32"
            )
        if (other := servos.setdefault(output.servo, output.name)) != output.name:
            raise ValueError(
                f"outputs {other} and {output.name} both have servo {output.servo}, expected a "
                f"number of its own for each"
            )


def meant(outputs: tuple[Output, ...], button: OutputButton) -> str | None:
    """Name of the output that a button of any pad or keyboard means: the light, the second dimmer,
    or the first switch. None: the vehicle has none such."""
    if button == "light":
        return next((o.name for o in outputs if o.name == LIGHT), None)
    dimmers = [o.name for o in outputs if o.kind == "dimmer" and o.name != LIGHT]
    switches = [o.name for o in outputs if o.kind == "switch"]
    return next(iter(switches if button == "laser" else dimmers), None)


def gripper_of(outputs: tuple[Output, ...]) -> Output | None:
    return next((output for output in outputs if output.kind == "gripper"), None)


def refusal(outputs: tuple[Output, ...], name: str, value: float | None, *, armed: bool) -> str:
    """Why an output cannot be set to a value; empty: it can."""
    output = next((each for each in outputs if each.name == name), None)
    if output is None:
        known = ", ".join(each.name for each in outputs) or "none"
        return f"this vehicle has no output {name!r}; there are: {known}"
    if output.kind == "gripper":
        return f"{name} is a gripper: it moves while its button is held, and takes no value"
    if output.kind == "switch" and value not in (0.0, 1.0):
        return f"{name} is a switch and needs 0 (off) or 1 (on)"
    if value is None or not 0.0 <= value <= 1.0:
        return f"{name} needs a brightness between 0 and 1"
    if output.off_after is not None and value > 0.0 and not armed:
        return f"{name} can be on only while the drone is armed"
    return ""


def driven(
    outputs: tuple[Output, ...], status: VehicleStatus | None, gripper: float, now: int
) -> Outputs:
    """[-] What a driver does with each output at `now` [ns]. Without a status nothing is known of
    dimmers and switches, and they are left out.

    Args:
        status: the newest, whatever its age.
        gripper: as the `ActuatorGate` permits it.
    """
    values: Outputs = {}
    for output in outputs:
        if output.kind == "gripper":
            values[output.name] = gripper
        elif status is not None:
            value = status.outputs.get(output.name, 0.0)
            off_after = output.off_after
            # What `reference` says ends here too: it may hang.
            silent = off_after is not None and now - status.stamp_ns > off_after * 1e9
            off = silent or (off_after is not None and not status.armed)
            values[output.name] = 0.0 if off else value
    return values
