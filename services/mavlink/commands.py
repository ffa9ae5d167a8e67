"""What ground stations ask: COMMAND_LONG and COMMAND_INT, each of which is acknowledged, and what
they ask of any vehicle when they connect, answered from what is known."""

from collections.abc import Mapping
from math import isfinite
from typing import Any, NamedTuple

from messages.units import Ns
from services.mavlink.pilot import ReceivedPacket
from services.mavlink.telemetry import CHOSEN, choosable
from services.mavlink_io.packet import (
    FORCE,
    MESSAGE_IDS,
    MavCapability,
    MavCommand,
    MavlinkPacket,
    MavMissionResult,
    MavResult,
)
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


# [-] Major, minor, patch, 255 for a release: ground stations choose names and pages by it. The
# parameters have the names of ArduSub 4.5.
VERSION = 4 << 24 | 5 << 16 | 0 << 8 | 255
FTP_NAK, FTP_UNKNOWN_COMMAND = 128 + 1, 7
FTP_PAYLOAD = 251  # [B]
# Heard, and nothing is to be done about it.
EXPECTED = frozenset({"HEARTBEAT", "SYSTEM_TIME", "COMMAND_ACK", "STATUSTEXT", "MISSION_ACK"})
# There are no missions, fences and rally points.
MISSION_RESULTS = {
    "MISSION_REQUEST": MavMissionResult.INVALID_SEQUENCE,
    "MISSION_REQUEST_INT": MavMissionResult.INVALID_SEQUENCE,
    "MISSION_COUNT": MavMissionResult.UNSUPPORTED,
    "MISSION_CLEAR_ALL": MavMissionResult.ACCEPTED,
}


def autopilot_version() -> MavlinkPacket:
    capabilities = (
        MavCapability.COMMAND_INT | MavCapability.MAVLINK2 | MavCapability.PARAM_ENCODE_C_CAST
    )
    zeros = ("middleware_sw_version", "os_sw_version", "board_version")
    fields: dict[str, Any] = dict.fromkeys((*zeros, "vendor_id", "product_id", "uid"), 0) | {
        "capabilities": int(capabilities),
        "flight_sw_version": VERSION,
        "flight_custom_version": list(b"lindy\0\0\0"),
        "middleware_custom_version": [0] * 8,
        "os_custom_version": [0] * 8,
    }
    return MavlinkPacket("AUTOPILOT_VERSION", fields)


ASKED_FOR = {"AUTOPILOT_VERSION": autopilot_version}  # sent by request only


def answer(packet: ReceivedPacket, now: Ns) -> MavlinkPacket | None:
    """What this message, one of `ANSWERED`, is answered by; None: nothing."""
    fields, name = packet.fields, packet.name
    to = {
        "target_system": packet.sender.system,
        "target_component": packet.sender.component,
    }
    mission = {"mission_type": fields.get("mission_type", 0)}
    match name:
        case "TIMESYNC":  # tc1 of 0 asks for our clock; else it answers a question never asked
            same = {"tc1": now, "ts1": fields["ts1"]}
            return None if fields["tc1"] != 0 else MavlinkPacket(name, same)
        case "PING":
            return MavlinkPacket(name, to | {key: fields[key] for key in ("time_usec", "seq")})
        case "AUTOPILOT_VERSION_REQUEST":
            return autopilot_version()
        case "MISSION_REQUEST_LIST":
            return MavlinkPacket("MISSION_COUNT", to | mission | {"count": 0})
        case "LOG_REQUEST_LIST":
            none = ("id", "num_logs", "last_log_num", "time_utc", "size")
            return MavlinkPacket("LOG_ENTRY", dict.fromkeys(none, 0))
        case "FILE_TRANSFER_PROTOCOL":
            return MavlinkPacket(name, to | {"target_network": 0, "payload": _no_file(fields)})
        case _:
            result = int(MISSION_RESULTS[name])
            return MavlinkPacket("MISSION_ACK", to | mission | {"type": result})


ANSWERED = frozenset(
    {
        *("TIMESYNC", "PING", "AUTOPILOT_VERSION_REQUEST", "MISSION_REQUEST_LIST"),
        *("LOG_REQUEST_LIST", "FILE_TRANSFER_PROTOCOL", *MISSION_RESULTS),
    }
)


def _no_file(fields: Mapping[str, Any]) -> list[int]:
    """MAVLink FTP: refused, so that nobody waits for a time-out."""
    asked = bytes(fields["payload"]).ljust(12, b"\0")
    number = (int.from_bytes(asked[:2], "little") + 1) % 2**16
    head = number.to_bytes(2, "little") + bytes([asked[2], FTP_NAK, 1, asked[3], 0, 0])
    return list((head + bytes(4) + bytes([FTP_UNKNOWN_COMMAND])).ljust(FTP_PAYLOAD, b"\0"))
