"""The 3-D scene: newest pose, thrust and reference, and the path flown, thinned.

Where a simulator tells the truth, the truth is drawn. Else the estimate, at the surface point
(0, 0) as long as nobody knows north and east.
"""

from math import cos, dist, sin

from messages.message import Message
from messages.reference import Reference
from messages.state import Prediction, VehicleState
from messages.units import Quaternion, Vec3
from messages.vehicle import Actuation, Truth
from services.marine.summation import plain_sum
from services.marine.vehicle import Vehicle
from services.visualizer.batch import Frame

STEP_M = 0.05  # [m] points of the path are at least this far apart
TRAIL_POINTS = 5_000  # points waiting to be drawn; beyond that the oldest are dropped
FLOOR_STEP_M = 0.2  # [m] the floor is drawn anew when it is found this much deeper


class Scene:
    """Keeps the newest messages that the scene is drawn from."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._half_height = vehicle.size[2] / 2
        self._thrusters = len(vehicle.thruster)
        self._state: VehicleState | None = None
        self._truth: Truth | None = None
        self._reference: Reference | None = None
        self._prediction: Prediction | None = None
        self._thrust: list[float] = []
        self._shown: Message | None = None
        self._trail: list[Vec3] = []
        self._floor_depth = 0.0
        self._floor: Vec3 | None = None

    def hear(self, message: Message) -> None:
        if isinstance(message, Truth):
            self._truth = message
            self._fly(message.position)
            self._touch(message)
        elif isinstance(message, VehicleState):
            self._state = message
            if self._truth is None and (place := _place(message)) is not None:
                self._fly(place)
        elif isinstance(message, Reference):
            self._reference = message
        elif isinstance(message, Prediction):
            self._prediction = message
        elif isinstance(message, Actuation):
            self._thrust = list(message.thrust) if len(message.thrust) == self._thrusters else []

    def frame(self, start: int) -> Frame | None:
        """The present scene, or None when there is no new pose since the last call."""
        pose = self._truth or self._state
        if pose is None or pose is self._shown:
            return None
        self._shown = pose
        wanted, ahead = self._reference, self._prediction
        return Frame(
            time=pose.stamp_ns - start,
            position=_position(pose),
            attitude=unit(pose.attitude),
            thrust=self._thrust,
            wanted_depth=None if wanted is None else wanted.depth.position,
            wanted_heading=None if wanted is None else wanted.heading.position,
            now=None if ahead is None else _ahead(_position(pose), ahead),
            now_heading=0.0 if ahead is None else ahead.heading,
        )

    def newest_sample(self) -> int | None:
        """[ns] Sensor sample behind the newest state."""
        return None if self._state is None else self._state.sensor_ns

    def take_trail(self) -> list[Vec3]:
        """Points of the path since the last call, starting with the last one drawn; empty if fewer
        than two."""
        if len(self._trail) < 2:
            return []
        points, self._trail = self._trail, self._trail[-1:]
        return points

    def take_floor(self) -> Vec3 | None:
        """Where the vehicle has touched the sea floor since the last call; None: nowhere."""
        floor, self._floor = self._floor, None
        return floor

    def _fly(self, place: Vec3) -> None:
        if not self._trail or dist(place, self._trail[-1]) >= STEP_M:
            self._trail.append(place)
            del self._trail[:-TRAIL_POINTS]

    def _touch(self, truth: Truth) -> None:
        north, east, depth = truth.position
        depth += self._half_height
        if truth.on_floor and depth > self._floor_depth + FLOOR_STEP_M:
            self._floor_depth = depth
            self._floor = (north, east, depth)


def _ahead(here: Vec3, ahead: Prediction) -> Vec3:
    """Predicted present position of a vehicle drawn at `here`: only the predicted displacement is
    added, because the vehicle may be drawn at its true position instead of the estimated one."""
    c, s = cos(ahead.heading), sin(ahead.heading)
    north = here[0] + c * ahead.forward - s * ahead.starboard
    east = here[1] + s * ahead.forward + c * ahead.starboard
    return (north, east, ahead.depth)


def unit(q: Quaternion) -> Quaternion:
    """A quaternion of length one; no rotation where `q` is nothing."""
    length = plain_sum(part * part for part in q) ** 0.5
    if length < 1e-6:
        return (1.0, 0.0, 0.0, 0.0)
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)


def _position(pose: Truth | VehicleState) -> Vec3:
    if isinstance(pose, Truth):
        return pose.position
    return _place(pose) or (0.0, 0.0, pose.depth.value)


def _place(state: VehicleState) -> Vec3 | None:
    """Estimated position, where it is known."""
    if state.north is None or state.east is None:
        return None
    return (state.north.value, state.east.value, state.depth.value)
