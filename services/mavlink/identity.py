"""What ground stations ask of any vehicle when they connect, answered from what is known."""

from collections.abc import Callable, Mapping

from services.mavlink.packets import ReceivedPacket
from services.mavlink.telemetry import Snapshot
from services.mavlink_io.numbers import MavCapability, MavMissionResult
from services.mavlink_io.packet import MavlinkPacket

# [-] Major, minor, patch, 255 for a release: ground stations choose names and pages by it. The
# parameters have the names of ArduSub 4.5.
VERSION = 4 << 24 | 5 << 16 | 0 << 8 | 255
FTP_NAK, FTP_UNKNOWN_COMMAND = 128 + 1, 7
FTP_PAYLOAD = 251  # [B]
Answer = Callable[[ReceivedPacket, Snapshot], MavlinkPacket | None]

# Heard, and nothing is to be done about it.
EXPECTED = frozenset({"HEARTBEAT", "SYSTEM_TIME", "COMMAND_ACK", "STATUSTEXT", "MISSION_ACK"})


def autopilot_version(_known: Snapshot) -> MavlinkPacket:
    capabilities = (
        MavCapability.COMMAND_INT | MavCapability.MAVLINK2 | MavCapability.PARAM_ENCODE_C_CAST
    )
    return MavlinkPacket(
        "AUTOPILOT_VERSION",
        {
            "capabilities": int(capabilities),
            "flight_sw_version": VERSION,
            "middleware_sw_version": 0,
            "os_sw_version": 0,
            "board_version": 0,
            "flight_custom_version": list(b"lindy\0\0\0"),
            "middleware_custom_version": [0] * 8,
            "os_custom_version": [0] * 8,
            "vendor_id": 0,
            "product_id": 0,
            "uid": 0,
        },
    )


def _to(packet: ReceivedPacket) -> dict[str, int]:
    return {
        "target_system": packet.sender.system,
        "target_component": packet.sender.component,
    }


def _timesync(packet: ReceivedPacket, known: Snapshot) -> MavlinkPacket | None:
    """tc1 of 0 asks for our clock; anything else is the answer to a question never asked."""
    if packet.fields["tc1"] != 0:
        return None
    return MavlinkPacket("TIMESYNC", {"tc1": known.now, "ts1": packet.fields["ts1"]})


def _ping(packet: ReceivedPacket, _: Snapshot) -> MavlinkPacket:
    same = {name: packet.fields[name] for name in ("time_usec", "seq")}
    return MavlinkPacket("PING", same | _to(packet))


def _no_missions(packet: ReceivedPacket, _: Snapshot) -> MavlinkPacket:
    """Missions, fences and rally points: there are none."""
    kind = packet.fields.get("mission_type", 0)
    return MavlinkPacket("MISSION_COUNT", _to(packet) | {"count": 0, "mission_type": kind})


def _mission_result(
    result: MavMissionResult,
) -> Callable[[ReceivedPacket, Snapshot], MavlinkPacket]:
    def answer(packet: ReceivedPacket, _: Snapshot) -> MavlinkPacket:
        kind = packet.fields.get("mission_type", 0)
        return MavlinkPacket(
            "MISSION_ACK", _to(packet) | {"type": int(result), "mission_type": kind}
        )

    return answer


def _no_logs(_packet: ReceivedPacket, _: Snapshot) -> MavlinkPacket:
    fields = ("id", "num_logs", "last_log_num", "time_utc", "size")
    return MavlinkPacket("LOG_ENTRY", dict.fromkeys(fields, 0))


def _no_files(packet: ReceivedPacket, _: Snapshot) -> MavlinkPacket:
    """MAVLink FTP: refused, so that nobody waits for a time-out."""
    asked = bytes(packet.fields["payload"]).ljust(12, b"\0")
    number = (int.from_bytes(asked[:2], "little") + 1) % 2**16
    head = number.to_bytes(2, "little") + bytes([asked[2], FTP_NAK, 1, asked[3], 0, 0])
    answer = (head + bytes(4) + bytes([FTP_UNKNOWN_COMMAND])).ljust(FTP_PAYLOAD, b"\0")
    fields = _to(packet) | {"target_network": 0, "payload": list(answer)}
    return MavlinkPacket("FILE_TRANSFER_PROTOCOL", fields)


def _version(_packet: ReceivedPacket, known: Snapshot) -> MavlinkPacket:
    return autopilot_version(known)


# Name of a message → its answer; None: no answer.
ANSWERS: Mapping[str, Answer] = {
    "TIMESYNC": _timesync,
    "PING": _ping,
    "AUTOPILOT_VERSION_REQUEST": _version,
    "MISSION_REQUEST_LIST": _no_missions,
    "MISSION_REQUEST": _mission_result(MavMissionResult.INVALID_SEQUENCE),
    "MISSION_REQUEST_INT": _mission_result(MavMissionResult.INVALID_SEQUENCE),
    "MISSION_COUNT": _mission_result(MavMissionResult.UNSUPPORTED),
    "MISSION_CLEAR_ALL": _mission_result(MavMissionResult.ACCEPTED),
    "LOG_REQUEST_LIST": _no_logs,
    "FILE_TRANSFER_PROTOCOL": _no_files,
}
ASKED_FOR: Mapping[str, Callable[[Snapshot], MavlinkPacket]] = {
    "AUTOPILOT_VERSION": autopilot_version,
}  # sent by request only
