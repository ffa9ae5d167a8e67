"""The vehicle as a whole: its status, what its thrusters did, what its own autopilot estimates, and
(in simulation) the truth."""

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, UnsetType

from messages.message import Message, Notices
from messages.pilot import FlightMode, StopDistance
from messages.units import (
    Count,
    Finite,
    Name,
    Names,
    NotNegative,
    Outputs,
    Quaternion,
    Stamp,
    Stick,
    Thrusts,
    Vec3,
)

Activity = Literal["starting", "ready", "piloted", "stopping", "goto", "follow"]
OWN_WAY: tuple[Activity, ...] = ("goto", "follow")  # it moves by itself, as it was asked to
# The conditions that make the drone act by itself; services/reference/failsafe/ has their table.
Failsafe = Literal[
    "none", "leak", "battery_critical", "state_lost", "imu_lost", "link_lost", "pilot_lost"
]
# What a condition makes the drone do, the mildest first: notice: say it; limit: go no further that
# way; stop: come to rest and hold; ascend: rise slowly; surface: stay at the surface
# What gives the sticks back: centring them, once what was lost for a moment is there again; the
# request `resume`; or that after the condition has ended, which has to be waited for
Returns = Literal["centre", "resume", "wait"]
Reaction = Literal["notice", "limit", "stop", "ascend", "surface"]


class PlaceAhead(msgspec.Struct, frozen=True):
    """A way-point of the path that is followed."""

    north: Finite  # [m]
    east: Finite  # [m]


PlacesAhead = Annotated[tuple[PlaceAhead, ...], msgspec.Meta(max_length=8)]


class VehicleStatus(Message, frozen=True, kw_only=True):
    """From `reference`, five times a second and at every change."""

    activity: Activity
    armed: bool
    flight_mode: FlightMode = "stabilised"  # what the drone holds by itself
    failsafe: Failsafe = "none"  # the condition that acts, the gravest of several
    reaction: Reaction | None = None  # what it makes the drone do now; None: nothing acts
    since_ns: Stamp | None = None  # [ns] when that condition began
    next_ns: Stamp | None = None  # [ns] when its next reaction begins; None: there is none
    resumable: bool = False  # the request `resume` would be granted now
    returns: Returns | None = None  # what gives the pilot his sticks back; None: he has them
    acting: Notices = ()  # every condition that acts; one that is none of `conditions` has ended
    conditions: Names = ()  # all that hold now, the gravest first; most only have to be known
    pilot: Name = ""  # who has control; empty: nobody
    epoch: Count = 0  # authority epoch granted last: commands with another one are refused
    light: Stick = 0.0  # [-] 0 … 1: the output of this name; 0 where the vehicle has none
    notices: Notices = ()  # why it is not ready, and every condition that does not act
    stop: StopDistance | None = None  # while stopping: distance from the stop request to standstill
    # Where it is, for those who watch many drones; absent: the state does not know it.
    depth: Finite | UnsetType = UNSET  # [m] positive down
    heading: Finite | UnsetType = UNSET  # [rad] clockwise from north, as far as it is known; ±π
    # By which the newest stop of heave was moved from its plan to the vehicle; absent: not moved.
    depth_moved: Finite | UnsetType = UNSET  # [m]
    # [-] of the vehicle file's outputs, by name: dimmers and switches as they are to be, 0 … 1; a
    # gripper as it moves at this instant, + opens.
    outputs: Outputs = msgspec.field(default_factory=dict[str, float])
    altitude: Finite | UnsetType = UNSET  # [m] above the bottom; absent: not measured now
    altitude_wanted: Finite | UnsetType = UNSET  # [m] that is held; absent: none is
    goal: tuple[Finite, Finite] | UnsetType = UNSET  # [m] north, east it goes to; absent: to none
    waypoints: PlacesAhead | UnsetType = UNSET  # the next ones of a path; absent: it follows none


class Actuation(Message, frozen=True, kw_only=True):
    """What the thruster driver did with the newest command, and when."""

    # [N] per thruster: from the measured speed where there is one (0 when dead, of the opposite
    # sign when reversed); else what the driver expects from its commands.
    thrust: Thrusts
    measured: bool = False  # thrust was measured; False: expected from the commands
    actuated_ns: Stamp | None  # [ns] when the newest command took effect
    sensor_ns: Stamp | None  # [ns] sensor sample behind that command
    pilot_ns: Stamp | None  # [ns] pilot command behind that command
    stale: bool  # True: no valid command, thrusters are stopped
    power: NotNegative  # [W] electrical
    # [-] of the vehicle file's outputs, as driven now; of a driver that has not heard, left out
    outputs: Outputs = msgspec.field(default_factory=dict[str, float])


class VehicleEstimate(Message, frozen=True, kw_only=True):
    """What the vehicle's own autopilot estimates: to compare with `state`, never to fly by. Each
    message has what one message of the autopilot says, and None for the rest."""

    roll: Finite | None = None  # [rad] + right wing down
    pitch: Finite | None = None  # [rad] + nose up
    heading: Finite | None = None  # [rad] clockwise from its own north, ±π or 0 … 2π
    depth: Finite | None = None  # [m] positive down, of its own surface
    depth_rate: Finite | None = None  # [m/s] positive down
    angular_rate: Vec3 | None = None  # [rad/s] body FRD


class Truth(Message, frozen=True, kw_only=True):
    """Ground truth, which only a simulator knows."""

    position: Vec3  # [m] NED
    attitude: Quaternion  # [-] q_NB as w, x, y, z
    velocity: Vec3  # [m/s] body FRD, over the ground
    angular_rate: Vec3  # [rad/s] body FRD
    depth_rate: Finite  # [m/s] NED down
    roll: Finite  # [rad]
    pitch: Finite  # [rad]
    heading: Finite  # [rad] accumulates past ±π
    on_floor: bool
    current: Vec3 = (0.0, 0.0, 0.0)  # [m/s] of the water over the ground, NED
    tether_pull: Vec3 = (0.0, 0.0, 0.0)  # [N] of the tether on the vehicle, NED
    faults: Names = ()  # simulated faults in force, as `part: fault`
