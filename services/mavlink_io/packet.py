"""One MAVLink message as plain values, without its frame, and the numbers of MAVLink 2 that are
used here (https://mavlink.io/en/messages/ardupilotmega.html). A test compares each of them with the
dialect of pymavlink, which only io/ imports."""

from enum import IntEnum, IntFlag
from typing import Any, NamedTuple

GROUND_STATION, SUBMARINE = 6, 12  # type in a HEARTBEAT
ARDUPILOT, NO_AUTOPILOT = 3, 8  # autopilot in a HEARTBEAT
AUTOPILOT = 1  # component
SET_MODE = 11  # the message whose acknowledgement names it in place of a command
FORCE = 21196.0  # param2 of COMPONENT_ARM_DISARM
NO_AXIS = 32767  # MANUAL_CONTROL: this axis is not there
NO_CHANNEL = 65535  # RC_CHANNELS_OVERRIDE: this channel is not there, and stays as it is

# Messages that can be asked for by their number: name in the dialect → number.
MESSAGE_IDS = {
    "HEARTBEAT": 0,
    "SYS_STATUS": 1,
    "SYSTEM_TIME": 2,
    "ATTITUDE": 30,
    "LOCAL_POSITION_NED": 32,
    "GLOBAL_POSITION_INT": 33,
    "VFR_HUD": 74,
    "BATTERY_STATUS": 147,
    "AUTOPILOT_VERSION": 148,
    "AHRS2": 178,
    "HOME_POSITION": 242,
    "EXTENDED_SYS_STATE": 245,
    "NAMED_VALUE_FLOAT": 251,
}


class MavCommand(IntEnum):
    """MAV_CMD: those that are sent, or answered with more than `unsupported`."""

    NAV_RETURN_TO_LAUNCH = 20
    DO_SET_MODE = 176
    DO_SET_SERVO = 183
    DO_PAUSE_CONTINUE = 193
    DO_MOUNT_CONTROL = 205
    DO_MOTOR_TEST = 209
    PREFLIGHT_CALIBRATION = 241
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    COMPONENT_ARM_DISARM = 400
    GET_HOME_POSITION = 410
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    DO_GIMBAL_MANAGER_PITCHYAW = 1000


class MavResult(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class MavSeverity(IntEnum):
    """MAV_SEVERITY."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    INFO = 6


class MavState(IntEnum):
    """MAV_STATE."""

    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5


class MavModeFlag(IntFlag):
    """MAV_MODE_FLAG."""

    CUSTOM_MODE_ENABLED = 1
    STABILIZE_ENABLED = 16
    MANUAL_INPUT_ENABLED = 64
    SAFETY_ARMED = 128


class MavLandedState(IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2


class MavSensor(IntFlag):
    """MAV_SYS_STATUS_SENSOR: what SYS_STATUS reports."""

    ABSOLUTE_PRESSURE = 8
    MOTOR_OUTPUTS = 32768
    GEOFENCE = 1048576
    AHRS = 2097152
    BATTERY = 33554432
    PREARM_CHECK = 268435456


class MavCapability(IntFlag):
    """MAV_PROTOCOL_CAPABILITY."""

    COMMAND_INT = 8
    MAVLINK2 = 8192
    PARAM_ENCODE_C_CAST = 131072


class MavMissionResult(IntEnum):
    """MAV_MISSION_RESULT."""

    ACCEPTED = 0
    UNSUPPORTED = 3
    INVALID_SEQUENCE = 13


class MavDataStream(IntEnum):
    """MAV_DATA_STREAM."""

    ALL = 0
    EXTENDED_STATUS = 2
    POSITION = 6
    EXTRA1 = 10
    EXTRA2 = 11
    EXTRA3 = 12


class GroundStation(NamedTuple):
    """Who sent a packet: a system and component id, at one end of one link."""

    link: str  # `tcp 127.0.0.1:40112`
    system: int
    component: int

    @property
    def pilot(self) -> str:
        """Its name as a pilot."""
        return f"ground station {self.system}/{self.component}"


class MavlinkPacket(NamedTuple):
    """A message, who sent it and over which link; 0, 0 and none in those that this side sends."""

    name: str  # as in the dialect: ATTITUDE
    fields: dict[str, Any]
    system: int = 0
    component: int = 0
    link: str = ""  # `tcp 127.0.0.1:40112`

    @property
    def sender(self) -> GroundStation:
        return GroundStation(self.link, self.system, self.component)


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
