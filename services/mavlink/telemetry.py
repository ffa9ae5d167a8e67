"""The drone's messages as MAVLink telemetry, and how often each link gets them. Pure; a packet
is None while its content is not known.

Every number fits its field, whatever a message says: MAVLink's fields are narrower than ours.
There is no latitude and longitude: both are 0 in every packet that has them. A flight mode has the
name of the ArduSub mode that behaves like it: ArduSub's ALT_HOLD holds depth and heading, its
SURFTRAK height and heading, its STABILIZE the heading alone. Depth alone is held by none of them;
it is shown as ALT_HOLD and cannot be chosen from a ground station."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import degrees, hypot, pi, tau
from typing import Any, NamedTuple

from messages.pilot import FlightMode
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import OWN_WAY, VehicleStatus
from services.marine.attitude import level_velocity, turned, wrapped
from services.mavlink_io.packet import (
    ARDUPILOT,
    SUBMARINE,
    MavCapability,
    MavDataStream,
    MavLandedState,
    MavlinkPacket,
    MavModeFlag,
    MavSensor,
    MavState,
)

NAMES = {0: "STABILIZE", 2: "ALT_HOLD", 4: "GUIDED", 16: "POSHOLD", 19: "MANUAL", 21: "SURFTRAK"}
# [-] Major, minor, patch, 255 for a release: ground stations choose names and pages by it. The
# parameters have the names of ArduSub 4.5.
VERSION = 4 << 24 | 5 << 16 | 0 << 8 | 255
GUIDED = 4  # the drone goes to a place or follows a path by itself

SHOWN: dict[FlightMode, int] = {
    "manual": 19,
    "heading_hold": 0,
    "depth_hold": 2,
    "stabilised": 2,
    "station_keeping": 16,
    "altitude_hold": 21,
}
CHOSEN: dict[int, FlightMode] = {
    number: mode for mode, number in SHOWN.items() if mode != "depth_hold"
}


def custom_mode(status: VehicleStatus) -> int:
    return GUIDED if status.activity in OWN_WAY else SHOWN[status.flight_mode]


def choosable() -> str:
    """`STABILIZE (0), ALT_HOLD (2), …`"""
    return ", ".join(f"{NAMES[number]} ({number})" for number in sorted(CHOSEN))


INT16, INT32, UINT16 = 2**15 - 1, 2**31 - 1, 2**16 - 1
Fields = dict[str, Any]
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


# What makes the fields of a message; None or nothing: their content is not known.


def heartbeat(known: Snapshot) -> Fields | None:
    """The drone's sign of life: none without its status, so that ground stations notice."""
    if (status := known.status) is None:
        return None
    base = MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.MANUAL_INPUT_ENABLED
    if status.flight_mode != "manual":
        base |= MavModeFlag.STABILIZE_ENABLED
    if status.armed:
        base |= MavModeFlag.SAFETY_ARMED
    return {
        "type": SUBMARINE,
        "autopilot": ARDUPILOT,
        "base_mode": int(base),
        "custom_mode": custom_mode(status),
        "system_status": int(_system_status(status)),
        "mavlink_version": 3,
    }


def _system_status(status: VehicleStatus) -> MavState:
    if status.failsafe != "none":
        return MavState.CRITICAL
    if status.activity == "starting":
        return MavState.CALIBRATING
    return MavState.ACTIVE if status.armed else MavState.STANDBY


def sys_status(known: Snapshot) -> Fields | None:
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
    nothing = ("load", "drop_rate_comm", "errors_comm", *(f"errors_count{n}" for n in range(1, 5)))
    return dict.fromkeys(nothing, 0) | {
        "onboard_control_sensors_present": int(here),
        "onboard_control_sensors_enabled": int(here),
        "onboard_control_sensors_health": int(well),
        "voltage_battery": _millivolts(known.battery, UINT16),
        "current_battery": _centiamperes(known.battery),
        "battery_remaining": _remaining(known.battery),
    }


def system_time(known: Snapshot) -> Fields:
    return {"time_unix_usec": max(0, known.utc_ns // 1000), "time_boot_ms": known.boot_ms}


def extended_sys_state(known: Snapshot) -> Fields | None:
    if known.status is None:
        return None
    landed = MavLandedState.IN_AIR if known.status.armed else MavLandedState.ON_GROUND
    return {"vtol_state": 0, "landed_state": int(landed)}


def home_position(known: Snapshot) -> Fields | None:
    """At the surface, where the drone began; ground stations ask until they have one."""
    if known.status is None:
        return None
    zeros = ("latitude", "longitude", "altitude", "x", "y", "z")
    approach = {"approach_x": 0.0, "approach_y": 0.0, "approach_z": 0.0}
    return dict.fromkeys(zeros, 0) | approach | {"q": [1.0, 0.0, 0.0, 0.0]}


def battery_status(known: Snapshot) -> Fields | None:
    if (battery := known.battery) is None:
        return None
    used = battery.used_wh
    return {
        "id": 0,
        "battery_function": 1,  # for everything
        "type": 0,  # not known
        "temperature": INT16,  # not known
        "voltages": [_millivolts(battery, UINT16 - 1)] + [UINT16] * 9,
        "current_battery": _centiamperes(battery),
        "current_consumed": -1,  # not known
        "energy_consumed": -1 if used is None else _fitting(used * WATT_HOUR, INT32),
        "battery_remaining": _remaining(battery),
    }


def named_values(known: Snapshot) -> list[Fields]:
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
        {"time_boot_ms": known.boot_ms, "name": name.encode(), "value": value}
        for name, value in values.items()
    ]


def autopilot_version(_: Snapshot | None = None) -> Fields:
    capabilities = (
        MavCapability.COMMAND_INT | MavCapability.MAVLINK2 | MavCapability.PARAM_ENCODE_C_CAST
    )
    zeros = ("middleware_sw_version", "os_sw_version", "board_version")
    return dict.fromkeys((*zeros, "vendor_id", "product_id", "uid"), 0) | {
        "capabilities": int(capabilities),
        "flight_sw_version": VERSION,
        "flight_custom_version": list(b"lindy\0\0\0"),
        "middleware_custom_version": [0] * 8,
        "os_custom_version": [0] * 8,
    }


# The same of the state, which is known then.


def attitude(known: Snapshot, state: VehicleState) -> Fields:
    return {
        "time_boot_ms": known.boot_ms,
        "roll": state.roll.value,
        "pitch": state.pitch.value,
        "yaw": wrapped(_heading(state)),
        "rollspeed": 0.0,  # the state has none
        "pitchspeed": 0.0,
        "yawspeed": state.yaw_rate.value,
    }


def ahrs2(_: Snapshot, state: VehicleState) -> Fields:
    """Cockpit takes the depth from its altitude."""
    return {
        "roll": state.roll.value,
        "pitch": state.pitch.value,
        "yaw": wrapped(_heading(state)),
        "altitude": -state.depth.value,
        "lat": 0,
        "lng": 0,
    }


def vfr_hud(_: Snapshot, state: VehicleState) -> Fields:
    return {
        "airspeed": 0.0,
        "groundspeed": hypot(*_horizontal(state)),
        "heading": int(degrees(_heading(state)) % 360.0) % 360,
        "throttle": 0,
        "alt": -state.depth.value,
        "climb": -state.depth_rate.value,
    }


def global_position_int(known: Snapshot, state: VehicleState) -> Fields:
    """`relative_alt` is the depth, negative down."""
    height = _fitting(-state.depth.value * 1e3, INT32)
    north, east, down = _velocity(state)
    return {
        "time_boot_ms": known.boot_ms,
        "lat": 0,
        "lon": 0,
        "alt": height,
        "relative_alt": height,
        "vx": _fitting(north * 100.0, INT16),
        "vy": _fitting(east * 100.0, INT16),
        "vz": _fitting(down * 100.0, INT16),
        "hdg": int(degrees(_heading(state)) % 360.0 * 100.0) % 36000,
    }


def local_position_ned(known: Snapshot, state: VehicleState) -> Fields | None:
    """Only of a drone that measures its position."""
    if state.north is None or state.east is None or not (state.north.valid and state.east.valid):
        return None
    north, east, down = _velocity(state)
    return {
        "time_boot_ms": known.boot_ms,
        "x": state.north.value,
        "y": state.east.value,
        "z": state.depth.value,
        "vx": north,
        "vy": east,
        "vz": down,
    }


def _of_state(
    make: Callable[[Snapshot, VehicleState], Fields | None],
) -> Callable[[Snapshot], Fields | None]:
    return lambda known: None if known.state is None else make(known, known.state)


# Name of a message → how often it is sent by default [1/s], and what makes its fields. Each can be
# streamed at a rate of its own.
TABLE: Mapping[str, tuple[float, Callable[[Snapshot], Fields | list[Fields] | None]]] = {
    "HEARTBEAT": (1.0, heartbeat),
    "SYS_STATUS": (2.0, sys_status),
    "SYSTEM_TIME": (1.0, system_time),
    "ATTITUDE": (20.0, _of_state(attitude)),
    "LOCAL_POSITION_NED": (5.0, _of_state(local_position_ned)),
    "GLOBAL_POSITION_INT": (5.0, _of_state(global_position_int)),
    "VFR_HUD": (10.0, _of_state(vfr_hud)),
    "BATTERY_STATUS": (1.0, battery_status),
    "AHRS2": (5.0, _of_state(ahrs2)),
    "HOME_POSITION": (0.0, home_position),
    "AUTOPILOT_VERSION": (0.0, autopilot_version),
    "EXTENDED_SYS_STATE": (1.0, extended_sys_state),
    "NAMED_VALUE_FLOAT": (2.0, named_values),
}
DEFAULT_HZ = {name: hz for name, (hz, _) in TABLE.items()}


def made(name: str, known: Snapshot) -> list[MavlinkPacket]:
    """The packets of a message of the table."""
    fields = TABLE[name][1](known)
    every = fields if isinstance(fields, list) else [fields]
    return [MavlinkPacket(name, each) for each in every if each is not None]


def _heading(state: VehicleState) -> float:
    """[rad] By the magnetometer where there is one; else the control heading."""
    north = state.heading_navigation
    return north.value if north is not None and north.valid else state.heading.value


def _velocity(state: VehicleState) -> tuple[float, float, float]:
    """[m/s] NED; 0 where it is not measured."""
    north, east = turned(_horizontal(state), _heading(state))
    return north, east, state.depth_rate.value


def _horizontal(state: VehicleState) -> tuple[float, float]:
    """[m/s] Ahead and to starboard, level; 0 where it is not measured."""
    return level_velocity(state) or (0.0, 0.0)


def _millivolts(battery: BatterySample | None, most: int) -> int:
    return UINT16 if battery is None else _fitting(battery.voltage * 1e3, most)


def _centiamperes(battery: BatterySample | None) -> int:
    """[cA] -1: not known."""
    current = None if battery is None else battery.current
    return -1 if current is None else _fitting(current * 100.0, INT16)


def _remaining(battery: BatterySample | None) -> int:
    """[%] -1: not known."""
    charge = None if battery is None else battery.charge
    return -1 if charge is None else round(100.0 * max(0.0, charge))


def _fitting(value: float, most: int) -> int:
    """Rounded, and within ± `most`."""
    return round(min(float(most), max(-float(most), value)))


HIGHEST_HZ = 50.0  # nothing is sent more often
OFF: Ns = 0
# What a stream of REQUEST_DATA_STREAM consists of. The others are of nothing that is sent here.
STREAMS: dict[int, tuple[str, ...]] = {
    MavDataStream.EXTENDED_STATUS: ("SYS_STATUS", "NAMED_VALUE_FLOAT"),
    MavDataStream.POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    MavDataStream.EXTRA1: ("ATTITUDE", "AHRS2"),
    MavDataStream.EXTRA2: ("VFR_HUD",),
    MavDataStream.EXTRA3: ("BATTERY_STATUS", "SYSTEM_TIME"),
}
STREAMS[MavDataStream.ALL] = tuple(name for names in STREAMS.values() for name in names)


def period_ns(hz: float) -> Ns:
    """[ns] 0: never."""
    return OFF if not hz > 0.0 else round(1e9 / min(hz, HIGHEST_HZ))


@dataclass(slots=True)
class LinkStreams:
    """What one link is sent, and how often."""

    _periods: dict[str, Ns] = field(
        default_factory=lambda: {name: period_ns(hz) for name, hz in DEFAULT_HZ.items()}
    )
    _due: dict[str, Ns] = field(default_factory=lambda: dict.fromkeys(DEFAULT_HZ, 0))

    def due(self, now: Ns) -> list[str]:
        """Names of the messages to send now. What is late is not sent twice."""
        names = [n for n, p in self._periods.items() if p != OFF and self._due[n] <= now]
        for name in names:
            period = self._periods[name]
            self._due[name] = max(self._due[name] + period, now + period // 2)
        return names

    def every(self, name: str, period: Ns, now: Ns) -> None:
        """Send it this often from now on; `OFF`: never. A heartbeat is never off."""
        if name == "HEARTBEAT" and period == OFF:
            return
        shortest = period_ns(HIGHEST_HZ)
        self._periods[name] = OFF if period == OFF else max(shortest, period)
        self._due[name] = now

    def period(self, name: str) -> Ns:
        return self._periods[name]
