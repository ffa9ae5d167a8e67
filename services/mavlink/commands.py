"""COMMAND_LONG and COMMAND_INT: what each asks for. Every command is acknowledged."""

from collections.abc import Mapping
from math import isfinite
from typing import Any, NamedTuple

from services.mavlink.modes import CHOSEN, choosable
from services.mavlink_io.numbers import FORCE, MESSAGE_IDS, MavCommand, MavResult
from services.piloting.pilot_intents import Intent, ModeIntent

MESSAGE_NAMES = {number: name for name, number in MESSAGE_IDS.items()}
CUSTOM_MODE = 1  # bit of DO_SET_MODE's base mode
# What is never done, and why: for people.
REFUSED = {
    MavCommand.DO_SET_SERVO: "no servo outputs here; lights, lasers, gripper: button functions",
    MavCommand.DO_MOUNT_CONTROL: "no tilt angles here; tilt: button functions or RC channel 8",
    MavCommand.DO_GIMBAL_MANAGER_PITCHYAW: "no tilt angles here; tilt: buttons or RC channel 8",
    MavCommand.DO_MOTOR_TEST: "no motor test here: only the controller writes to thrusters",
    MavCommand.PREFLIGHT_CALIBRATION: "nothing to calibrate by command: it is done at each start",
    MavCommand.PREFLIGHT_REBOOT_SHUTDOWN: "not rebooted from a ground station",
}


class Ask(NamedTuple):
    """For the drone to decide."""

    intent: Intent


class Refusal(NamedTuple):
    result: MavResult
    text: str = ""  # for people


class Show(NamedTuple):
    """Send a message once."""

    name: str


class SetStream(NamedTuple):
    """Send a message every so often."""

    name: str
    period_us: float  # 0: as by default; negative: never


class TellInterval(NamedTuple):
    """Say how often a message is sent."""

    name: str


Meaning = Ask | Refusal | Show | SetStream | TellInterval
UNSUPPORTED = Refusal(MavResult.UNSUPPORTED)
# Those without parameters that matter.
PLAIN: dict[MavCommand, Meaning] = {
    MavCommand.NAV_RETURN_TO_LAUNCH: Ask("home"),
    MavCommand.REQUEST_AUTOPILOT_CAPABILITIES: Show("AUTOPILOT_VERSION"),
    MavCommand.GET_HOME_POSITION: Show("HOME_POSITION"),
    **{command: Refusal(MavResult.DENIED, text) for command, text in REFUSED.items()},
}
NEVER = -1.0  # [µs] as an interval
NO_INTERVAL = "an interval is in µs: 0 as by default, -1 never"


def meaning(fields: Mapping[str, Any]) -> Meaning:
    """
    Args:
        fields: of COMMAND_LONG or COMMAND_INT.
    """
    number: int = fields["command"]
    first, second = float(fields["param1"]), float(fields["param2"])
    match number:
        case MavCommand.COMPONENT_ARM_DISARM:
            return arming(first, second)
        case MavCommand.DO_SET_MODE:
            return mode(int(first) if isfinite(first) else 0, second)
        case MavCommand.DO_PAUSE_CONTINUE:
            refusal = Refusal(MavResult.DENIED, "nothing to continue: steer, or choose a mode")
            return Ask("stop") if first == 0.0 else refusal
        case MavCommand.SET_MESSAGE_INTERVAL:
            name = _message(first)
            if name is None:
                return UNSUPPORTED
            good = isfinite(second) and (second >= 0.0 or second == NEVER)
            return SetStream(name, second) if good else Refusal(MavResult.DENIED, NO_INTERVAL)
        case MavCommand.GET_MESSAGE_INTERVAL:
            name = _message(first)
            return UNSUPPORTED if name is None else TellInterval(name)
        case MavCommand.REQUEST_MESSAGE:
            name = _message(first)
            return UNSUPPORTED if name is None else Show(name)
        case _:
            return PLAIN.get(number, UNSUPPORTED)  # type: ignore[call-overload]


def arming(arm: float, force: float) -> Meaning:
    """COMPONENT_ARM_DISARM. What forbids arming cannot be forced; disarming needs no force."""
    if arm == 1.0 and force == FORCE:
        return Refusal(MavResult.DENIED, "arming cannot be forced: see why it is refused")
    if arm not in (0.0, 1.0):
        return Refusal(MavResult.DENIED, "arm with 1, disarm with 0")
    return Ask("arm" if arm else "disarm")


def mode(base: int, custom: float) -> Meaning:
    """DO_SET_MODE, and the message SET_MODE."""
    known = base & CUSTOM_MODE and isfinite(custom) and CHOSEN.get(round(custom))
    if known and custom == round(custom):
        return Ask(ModeIntent(known))
    return Refusal(MavResult.FAILED, f"no such mode here; there are {choosable()}")


def _message(number: float) -> str | None:
    """Name of a message that can be sent by request."""
    return MESSAGE_NAMES.get(int(number)) if isfinite(number) else None
