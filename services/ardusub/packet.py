"""One MAVLink message, as plain values. Only io/ knows the library that encodes it."""

from typing import Any, NamedTuple

# Names of the protocol (common.xml) that this service uses.
GCS_TYPE, SUBMARINE, INVALID_AUTOPILOT, ARDUPILOTMEGA = 6, 12, 8, 3
ARMED_BIT, CUSTOM_MODE_BIT = 128, 1
AUTOPILOT = 1  # component
ARM_DISARM, SET_MODE, SET_INTERVAL, REQUEST_MESSAGE, SET_SERVO = 400, 176, 511, 512, 183
ACCEPTED = 0  # result of a command
UNUSED = 65535  # of an override channel 1 to 8: leave it as it is


class MavlinkPacket(NamedTuple):
    """A message and who sent it; 0, 0 in those that are sent by this side."""

    name: str
    fields: dict[str, Any]
    system: int = 0
    component: int = 0


def heartbeat() -> MavlinkPacket:
    """Ours, as a ground station. ArduSub needs it once a second."""
    return MavlinkPacket(
        "HEARTBEAT",
        {
            "type": GCS_TYPE,
            "autopilot": INVALID_AUTOPILOT,
            "base_mode": 0,
            "custom_mode": 0,
            "system_status": 4,
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
            "command": number,
            "confirmation": 0,
            **fields,
        },
    )
