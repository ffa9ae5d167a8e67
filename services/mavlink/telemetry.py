"""The drone's messages as MAVLink telemetry. Pure; a packet is None while its content is not known.

Every number fits its field, whatever a message says: MAVLink's fields are narrower than ours.
There is no latitude and longitude: both are 0 in every packet that has them.
"""

from collections.abc import Callable, Mapping
from math import atan2, cos, degrees, pi, sin, tau
from typing import NamedTuple

from messages.message import Estimate
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.attitude import level_velocity
from services.mavlink.modes import custom_mode
from services.mavlink_io.numbers import (
    ARDUPILOT,
    SUBMARINE,
    MavLandedState,
    MavModeFlag,
    MavSensor,
    MavState,
)
from services.mavlink_io.packet import MavlinkPacket

INT16, INT32, UINT16 = 2**15 - 1, 2**31 - 1, 2**16 - 1
WATT_HOUR = 36.0  # [hJ], the unit of BATTERY_STATUS


class Snapshot(NamedTuple):
    """What is known of the drone at one instant; None: not heard, or not for too long."""

    now: Ns
    boot_ns: Ns  # [ns] when the service began
    utc_ns: Ns  # [ns] now, on the wall
    status: VehicleStatus | None = None
    state: VehicleState | None = None
    battery: BatterySample | None = None
    tilt: float | None = None  # [rad] of the camera, + upwards
    gain: float = 1.0  # [-] of MANUAL_CONTROL

    @property
    def boot_ms(self) -> int:
        return ((self.now - self.boot_ns) // 1_000_000) % 2**32


def heartbeat(known: Snapshot) -> MavlinkPacket | None:
    """The drone's sign of life: none without its status, so that ground stations notice."""
    if (status := known.status) is None:
        return None
    base = MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.MANUAL_INPUT_ENABLED
    if status.flight_mode != "manual":
        base |= MavModeFlag.STABILIZE_ENABLED
    if status.armed:
        base |= MavModeFlag.SAFETY_ARMED
    return MavlinkPacket(
        "HEARTBEAT",
        {
            "type": SUBMARINE,
            "autopilot": ARDUPILOT,
            "base_mode": int(base),
            "custom_mode": custom_mode(status),
            "system_status": int(_system_status(status)),
            "mavlink_version": 3,
        },
    )


def _system_status(status: VehicleStatus) -> MavState:
    if status.failsafe != "none":
        return MavState.CRITICAL
    if status.activity == "starting":
        return MavState.CALIBRATING
    return MavState.ACTIVE if status.armed else MavState.STANDBY


def sys_status(known: Snapshot) -> MavlinkPacket | None:
    if (status := known.status) is None:
        return None
    here = MavSensor.ABSOLUTE_PRESSURE | MavSensor.AHRS | MavSensor.MOTOR_OUTPUTS
    here |= MavSensor.BATTERY | MavSensor.PREARM_CHECK
    well = MavSensor.MOTOR_OUTPUTS | MavSensor.GEOFENCE  # there is no fence to be outside of
    if (state := known.state) is not None:
        well |= MavSensor.ABSOLUTE_PRESSURE if state.depth.valid else MavSensor(0)
        well |= MavSensor.AHRS if state.heading.valid else MavSensor(0)
    well |= MavSensor.PREARM_CHECK if status.activity != "starting" else MavSensor(0)
    well |= MavSensor.BATTERY if known.battery is not None else MavSensor(0)
    return MavlinkPacket(
        "SYS_STATUS",
        {
            "onboard_control_sensors_present": int(here),
            "onboard_control_sensors_enabled": int(here),
            "onboard_control_sensors_health": int(well),
            "load": 0,
            "voltage_battery": _millivolts(known.battery, UINT16),
            "current_battery": _centiamperes(known.battery),
            "battery_remaining": _remaining(known.battery),
            "drop_rate_comm": 0,
            "errors_comm": 0,
            "errors_count1": 0,
            "errors_count2": 0,
            "errors_count3": 0,
            "errors_count4": 0,
        },
    )


def attitude(known: Snapshot) -> MavlinkPacket | None:
    if (state := known.state) is None:
        return None
    return MavlinkPacket(
        "ATTITUDE",
        {
            "time_boot_ms": known.boot_ms,
            "roll": state.roll.value,
            "pitch": state.pitch.value,
            "yaw": _wrapped(_heading(state)),
            "rollspeed": 0.0,  # the state has none
            "pitchspeed": 0.0,
            "yawspeed": state.yaw_rate.value,
        },
    )


def ahrs2(known: Snapshot) -> MavlinkPacket | None:
    """Cockpit takes the depth from its altitude."""
    if (state := known.state) is None:
        return None
    return MavlinkPacket(
        "AHRS2",
        {
            "roll": state.roll.value,
            "pitch": state.pitch.value,
            "yaw": _wrapped(_heading(state)),
            "altitude": -state.depth.value,
            "lat": 0,
            "lng": 0,
        },
    )


def vfr_hud(known: Snapshot) -> MavlinkPacket | None:
    if (state := known.state) is None:
        return None
    return MavlinkPacket(
        "VFR_HUD",
        {
            "airspeed": 0.0,
            "groundspeed": _speed(state),
            "heading": int(degrees(_heading(state)) % 360.0) % 360,
            "throttle": 0,
            "alt": -state.depth.value,
            "climb": -state.depth_rate.value,
        },
    )


def global_position_int(known: Snapshot) -> MavlinkPacket | None:
    """`relative_alt` is the depth, negative down."""
    if (state := known.state) is None:
        return None
    height = _fitting(-state.depth.value * 1e3, INT32)
    north, east, down = _velocity(state)
    heading = _heading(state)
    return MavlinkPacket(
        "GLOBAL_POSITION_INT",
        {
            "time_boot_ms": known.boot_ms,
            "lat": 0,
            "lon": 0,
            "alt": height,
            "relative_alt": height,
            "vx": _fitting(north * 100.0, INT16),
            "vy": _fitting(east * 100.0, INT16),
            "vz": _fitting(down * 100.0, INT16),
            "hdg": int(degrees(heading) % 360.0 * 100.0) % 36000,
        },
    )


def local_position_ned(known: Snapshot) -> MavlinkPacket | None:
    """Only of a drone that measures its position."""
    state = known.state
    if state is None or not (_valid(state.north) and _valid(state.east)):
        return None
    assert state.north is not None
    assert state.east is not None
    north, east, down = _velocity(state)
    return MavlinkPacket(
        "LOCAL_POSITION_NED",
        {
            "time_boot_ms": known.boot_ms,
            "x": state.north.value,
            "y": state.east.value,
            "z": state.depth.value,
            "vx": north,
            "vy": east,
            "vz": down,
        },
    )


def battery_status(known: Snapshot) -> MavlinkPacket | None:
    if (battery := known.battery) is None:
        return None
    return MavlinkPacket(
        "BATTERY_STATUS",
        {
            "id": 0,
            "battery_function": 1,  # for everything
            "type": 0,  # not known
            "temperature": INT16,  # not known
            "voltages": [_millivolts(battery, UINT16 - 1)] + [UINT16] * 9,
            "current_battery": _centiamperes(battery),
            "current_consumed": -1,  # not known
            "energy_consumed": _fitting(battery.used_wh * WATT_HOUR, INT32),
            "battery_remaining": _remaining(battery),
        },
    )


def extended_sys_state(known: Snapshot) -> MavlinkPacket | None:
    if known.status is None:
        return None
    landed = MavLandedState.IN_AIR if known.status.armed else MavLandedState.ON_GROUND
    return MavlinkPacket("EXTENDED_SYS_STATE", {"vtol_state": 0, "landed_state": int(landed)})


def home_position(known: Snapshot) -> MavlinkPacket | None:
    """At the surface, where the drone began; ground stations ask until they have one."""
    if known.status is None:
        return None
    zeros = ("latitude", "longitude", "altitude", "x", "y", "z")
    approach = {"approach_x": 0.0, "approach_y": 0.0, "approach_z": 0.0}
    fields = dict.fromkeys(zeros, 0) | approach | {"q": [1.0, 0.0, 0.0, 0.0]}
    return MavlinkPacket("HOME_POSITION", fields)


def system_time(known: Snapshot) -> MavlinkPacket:
    usec = max(0, known.utc_ns // 1000)
    return MavlinkPacket("SYSTEM_TIME", {"time_unix_usec": usec, "time_boot_ms": known.boot_ms})


def named_values(known: Snapshot) -> list[MavlinkPacket]:
    """What QGroundControl's panel of a submarine shows; names as ArduSub's."""
    if (status := known.status) is None:
        return []
    values = {"Lights1": max(0.0, status.light), "PilotGain": known.gain}
    values |= {"InputHold": 0.0, "RollPitch": 0.0}
    if known.tilt is not None:
        values["CamTilt"] = min(1.0, max(0.0, 0.5 + known.tilt / pi))  # level is 0.5
    if known.state is not None:
        values["TetherTrn"] = float(_fitting(known.state.heading.value / tau, INT32))
    return [
        MavlinkPacket(
            "NAMED_VALUE_FLOAT",
            {"time_boot_ms": known.boot_ms, "name": name.encode(), "value": value},
        )
        for name, value in values.items()
    ]


def _one(
    make: Callable[[Snapshot], MavlinkPacket | None],
) -> Callable[[Snapshot], list[MavlinkPacket]]:
    def packets(known: Snapshot) -> list[MavlinkPacket]:
        packet = make(known)
        return [] if packet is None else [packet]

    return packets


MADE: Mapping[str, Callable[[Snapshot], list[MavlinkPacket]]] = {
    "HEARTBEAT": _one(heartbeat),
    "SYS_STATUS": _one(sys_status),
    "SYSTEM_TIME": _one(system_time),
    "ATTITUDE": _one(attitude),
    "LOCAL_POSITION_NED": _one(local_position_ned),
    "GLOBAL_POSITION_INT": _one(global_position_int),
    "VFR_HUD": _one(vfr_hud),
    "BATTERY_STATUS": _one(battery_status),
    "AHRS2": _one(ahrs2),
    "HOME_POSITION": _one(home_position),
    "EXTENDED_SYS_STATE": _one(extended_sys_state),
    "NAMED_VALUE_FLOAT": named_values,
}  # name of a message → what makes it; each can be streamed at a rate of its own


def _valid(estimate: Estimate | None) -> bool:
    return estimate is not None and estimate.valid


def _heading(state: VehicleState) -> float:
    """[rad] By the magnetometer where there is one; else the control heading."""
    north = state.heading_navigation
    return north.value if north is not None and north.valid else state.heading.value


def _velocity(state: VehicleState) -> tuple[float, float, float]:
    """[m/s] NED; 0 where it is not measured."""
    forward, starboard = _horizontal(state)
    c, s = cos(_heading(state)), sin(_heading(state))
    return c * forward - s * starboard, s * forward + c * starboard, state.depth_rate.value


def _speed(state: VehicleState) -> float:
    forward, starboard = _horizontal(state)
    return (forward * forward + starboard * starboard) ** 0.5


def _horizontal(state: VehicleState) -> tuple[float, float]:
    """[m/s] Ahead and to starboard, level; 0 where it is not measured."""
    return level_velocity(state) or (0.0, 0.0)


def _wrapped(angle: float) -> float:
    """[rad] Within ±π."""
    return atan2(sin(angle), cos(angle))


def _millivolts(battery: BatterySample | None, most: int) -> int:
    return UINT16 if battery is None else _fitting(battery.voltage * 1e3, most)


def _centiamperes(battery: BatterySample | None) -> int:
    return -1 if battery is None else _fitting(battery.current * 100.0, INT16)


def _remaining(battery: BatterySample | None) -> int:
    """[%] -1: not known."""
    charge = None if battery is None else battery.charge
    return -1 if charge is None else round(100.0 * max(0.0, charge))


def _fitting(value: float, most: int) -> int:
    """Rounded, and within ± `most`."""
    return round(min(float(most), max(-float(most), value)))
