"""One MAVLink message as plain values, without its frame."""

from typing import Any, NamedTuple

from services.mavlink_io.numbers import AUTOPILOT, GROUND_STATION, NO_AUTOPILOT, MavState


class MavlinkPacket(NamedTuple):
    """A message, who sent it and over which link; 0, 0 and none in those that this side sends."""

    name: str  # as in the dialect: ATTITUDE
    fields: dict[str, Any]
    system: int = 0
    component: int = 0
    link: str = ""  # `tcp 127.0.0.1:40112`


def heartbeat() -> MavlinkPacket:
    """Ours, as a ground station. ArduSub needs it once a second."""
    return MavlinkPacket(
        "HEARTBEAT",
        {
            "type": GROUND_STATION,
            "autopilot": NO_AUTOPILOT,
            "base_mode": 0,
            "custom_mode": 0,
            "system_status": int(MavState.ACTIVE),
            "mavlink_version": 3,
        },
    )


def command(system: int, number: int, *params: float) -> MavlinkPacket:
    """A COMMAND_LONG to the autopilot of this system."""
    values = [*params, *[0.0] * (7 - len(params))]
    fields = {f"param{i}": float(value) for i, value in enumerate(values, 1)}
    return MavlinkPacket(
        "COMMAND_LONG",
        {
            "target_system": system,
            "target_component": AUTOPILOT,
            "command": int(number),
            "confirmation": 0,
            **fields,
        },
    )
