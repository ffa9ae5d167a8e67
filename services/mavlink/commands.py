"""What ground stations ask of any vehicle when they connect, answered from what is known; and what
is never done, and why."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from messages.pilot import FlightMode
from messages.units import Ns
from services.mavlink.telemetry import CHOSEN, autopilot_version
from services.mavlink_io.packet import (
    MESSAGE_IDS,
    MavCommand,
    MavlinkPacket,
    MavMissionResult,
)

MESSAGE_NAMES = {number: name for name, number in MESSAGE_IDS.items()}
CUSTOM_MODE = 1  # bit of DO_SET_MODE's base mode
# What is never done, and why: for people.
REFUSED = {
    MavCommand.DO_PAUSE_CONTINUE: "nothing to continue: steer, or choose a mode",
    MavCommand.DO_SET_SERVO: "no servo outputs here; lights, lasers, gripper: button functions",
    MavCommand.DO_MOUNT_CONTROL: "no tilt angles here; tilt: button functions or RC channel 8",
    MavCommand.DO_GIMBAL_MANAGER_PITCHYAW: "no tilt angles here; tilt: buttons or RC channel 8",
    MavCommand.DO_MOTOR_TEST: "no motor test here: only the controller writes to thrusters",
    MavCommand.PREFLIGHT_CALIBRATION: "nothing to calibrate by command: it is done at each start",
    MavCommand.PREFLIGHT_REBOOT_SHUTDOWN: "not rebooted from a ground station",
}


NEVER = -1.0  # [µs] as an interval
OF_ONE_MESSAGE = {
    MavCommand.REQUEST_AUTOPILOT_CAPABILITIES: "AUTOPILOT_VERSION",
    MavCommand.GET_HOME_POSITION: "HOME_POSITION",
}


def flight_mode(base: int, custom: float) -> FlightMode | None:
    """The mode of DO_SET_MODE and of SET_MODE; None: there is no such mode here."""
    if not (base & CUSTOM_MODE and isfinite(custom) and custom == round(custom)):
        return None
    return CHOSEN.get(round(custom))


def message_named(number: float) -> str | None:
    """Name of a message that can be sent by request."""
    return MESSAGE_NAMES.get(int(number)) if isfinite(number) else None


def message_asked(command: int, first: float) -> str | None:
    """Name of the message that a command with this first parameter wants once."""
    if command == MavCommand.REQUEST_MESSAGE:
        return message_named(first)
    return OF_ONE_MESSAGE.get(command)  # type: ignore[call-overload]


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


def answer(packet: MavlinkPacket, now: Ns) -> MavlinkPacket | None:
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
            return MavlinkPacket("AUTOPILOT_VERSION", autopilot_version())
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
