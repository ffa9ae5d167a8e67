"""Forces on the vessel other than those of open water: sea floor, tether.

The floor is a flat, stiff, damped plane with friction, acting on the corners of the hull; where it
is rough, the plane that touches it below the vehicle (terrain.py). Its stiffness scales with the
vehicle's mass: the hull on its corners is an oscillator of about FREQUENCY rad/s.

The tether's drag grows with depth. It hangs approximately vertically between ship and vehicle; each
end carries half of its transverse drag. A length L across a flow v has the drag of a cylinder,
½ ρ C_d d L |v| v (Morison's drag term; C_d of a cylinder 1.2, Hoerner 1965, p. 3-9), so the force
on the vehicle is

    F = −¼ ρ C_d d L |v| v      horizontally, L = depth + slack,

and vertically, along the tether, a small share of that. v is the vehicle's velocity through the
water. The tether's mass, weight in water (about zero) and shape are neglected.
"""

from copy import copy
from itertools import product
from math import exp, hypot, sqrt

from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import dot, to_body, to_world
from services.marine.summation import plain_sum
from services.marine.water import density_of
from services.simulator.settings import CurrentSettings, Settings, TetherSettings
from services.simulator.streams import CURRENT, white_noise
from services.simulator.terrain import SeaFloor

FREQUENCY = 40.0  # [rad/s] at 1.2 m/s the hull then sinks in about 2 cm
DAMPING_RATIO = 0.7  # [-] little rebound
FRICTION = 0.5  # [-] Coulomb, a hull on sand or clay; assumed
LENGTHWISE = 0.02  # [-] drag along a cable as a share of that across it; typical, assumed


class Barrier:
    """Solid space beyond `limit` in one direction of NED."""

    def __init__(self, limit: float, hull_size: Vec3, inertia: float) -> None:
        """
        Args:
            limit: [m] along the direction that points into the barrier; of the floor its depth.
            hull_size: [m] length, width, height; the origin is in its middle.
            inertia: [kg] of the vehicle with added mass, in heave.
        """
        length, width, height = hull_size
        self._limit = limit
        self._reach = sqrt(length * length + width * width + height * height) / 2
        self._corners = [
            (x * length / 2, y * width / 2, z * height / 2)
            for x, y, z in product((1, -1), repeat=3)
        ]
        # A level hull stands on four corners.
        self._stiffness = inertia * FREQUENCY**2 / 4  # [N/m] per corner
        self._damping = inertia * 2 * DAMPING_RATIO * FREQUENCY / 4  # [N s/m] per corner

    def moved(self, limit: float) -> "Barrier":
        """The same with another limit [m]."""
        barrier = copy(self)
        barrier._limit = limit
        return barrier

    def near(self, place: float) -> bool:
        """Whether the hull can touch it at some attitude.

        Args:
            place: [m] of the origin, in the direction of the limit.
        """
        return place + self._reach > self._limit

    def touches(self, place: float, towards_B: Vec3) -> bool:
        """Whether any corner of the hull touches it. Arguments as of `push`."""
        return any(self._sunk(corner, place, towards_B) > 0 for corner in self._corners)

    def push(self, place: float, towards_B: Vec3, nu: Vec6) -> Vec6:
        """Wrench [N, N m] on the hull, about the origin, in body axes.

        Args:
            place: [m] of the origin, in the direction of the limit.
            towards_B: that direction in body axes.
            nu: [m/s, rad/s] velocity over the ground in body axes.
        """
        surge = sway = heave = roll = pitch = yaw = 0.0
        for corner in self._corners:
            sunk = self._sunk(corner, place, towards_B)
            if sunk > 0:
                x, y, z = corner
                a, b, c = self._corner_force(corner, sunk, towards_B, nu)
                surge, sway, heave = surge + a, sway + b, heave + c
                roll, pitch, yaw = roll + y * c - z * b, pitch + z * a - x * c, yaw + x * b - y * a
        return surge, sway, heave, roll, pitch, yaw

    def _sunk(self, corner: Vec3, place: float, towards_B: Vec3) -> float:
        """[m] Penetration of a corner."""
        x, y, z = corner
        return place + towards_B[0] * x + towards_B[1] * y + towards_B[2] * z - self._limit

    def _corner_force(self, corner: Vec3, sunk: float, towards_B: Vec3, nu: Vec6) -> Vec3:
        """[N] in body axes: spring and damper that never pull, and friction along the plane."""
        x, y, z = corner
        u, v, w, p, q, r = nu
        u, v, w = u + q * z - r * y, v + r * x - p * z, w + p * y - q * x  # of the corner
        a, b, c = towards_B
        sinking = a * u + b * v + c * w  # [m/s]
        push = max(0.0, self._stiffness * sunk + self._damping * sinking)  # [N]
        u, v, w = u - sinking * a, v - sinking * b, w - sinking * c  # along the plane
        sliding = sqrt(u * u + v * v + w * w)  # [m/s]
        # Coulomb friction is discontinuous at rest, unsuitable for a fixed step: viscous near rest.
        grip = min(self._damping, FRICTION * push / sliding) if sliding > 0 else 0.0  # [N s/m]
        return -push * a - grip * u, -push * b - grip * v, -push * c - grip * w


class Tether:
    def __init__(self, settings: TetherSettings, water_density: float) -> None:
        """
        Args:
            water_density: [kg/m³].
        """
        self._slack = settings.slack
        # [N s²/m³] of drag at the vehicle per metre of tether
        self._drag = 0.25 * water_density * settings.drag_coefficient * settings.diameter

    def pull(self, depth: float, velocity: Vec3) -> Vec3:
        """Force [N] on the vehicle, NED, at its origin.

        Args:
            velocity: [m/s] NED through the water.
        """
        north, east, down = velocity
        drag = self._drag * (max(0.0, depth) + self._slack)  # [N s²/m²]
        across = drag * hypot(north, east)
        return -across * north, -across * east, -drag * LENGTHWISE * abs(down) * down


class Surroundings:
    def __init__(self, place: Settings, hull_size: Vec3, inertia: float, seed: int = 0) -> None:
        """
        Args:
            hull_size: [m] length, width, height.
            inertia: [kg] of the vehicle with added mass, in heave.
            seed: [-] 0 or more, of the terrain.
        """
        self.tether: Tether | None = None
        if place.tether is not None:
            self.tether = Tether(place.tether, density_of(place.water_density))
        self.floor = sea_floor(place, seed)
        self._way, depth = self.floor.plane((0.0, 0.0, 0.0))
        self._plane = Barrier(depth, hull_size, inertia)
        self._hull = plain_sum(hull_size)  # [m]

    def near(self, position: Vec3) -> tuple[Vec3, Barrier] | None:
        """The floor, if the hull may touch it, with the direction [-] NED that leads into it."""
        way, floor = self._floor_at(position)
        return (way, floor) if floor.near(dot(way, position)) else None

    def _floor_at(self, position: Vec3) -> tuple[Vec3, Barrier]:
        """The plane that touches the floor below the vehicle. High above a steep place it is the
        level one: the steep one would reach up to where there is water."""
        if not self.floor.rough:
            return self._way, self._plane
        below = self.floor.depth(position)
        way, limit = (0.0, 0.0, 1.0), below
        if below - position[2] < self._hull:
            way, limit = self.floor.plane(position)
        return way, self._plane.moved(limit)

    def floor_felt(self, position: Vec3, q_NB: Quaternion) -> bool:
        """Whether the hull touches the floor."""
        near = self.near(position)
        return near is not None and near[1].touches(dot(near[0], position), to_body(q_NB, near[0]))

    def push(self, near: tuple[Vec3, Barrier], position: Vec3, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """Wrench [N, N m] of the floor, for a velocity over the ground in body axes."""
        way, floor = near
        return floor.push(dot(way, position), to_body(q_NB, way), nu)

    def pull(self, depth: float, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """Wrench [N, N m] of the tether, for a velocity through the water in body axes."""
        return *to_body(q_NB, self.tether_pull(depth, q_NB, nu)), 0.0, 0.0, 0.0

    def tether_pull(self, depth: float, q_NB: Quaternion, nu: Vec6) -> Vec3:
        """[N] NED, for a velocity through the water in body axes; none without a tether."""
        if self.tether is None:
            return (0.0, 0.0, 0.0)
        u, v, w, *_ = nu
        return self.tether.pull(depth, to_world(q_NB, (u, v, w)))


def sea_floor(site: Settings, seed: int = 0) -> SeaFloor:
    slope = (site.slope_north, site.slope_east)
    return SeaFloor(site.floor_depth, slope, site.terrain, seed)


HELD = 0.1  # [s] step of the random part; short compared with its time constant


class Current:
    """First-order Gauss-Markov process about the mean (Fossen 2011, §8.4), solved exactly."""

    def __init__(self, settings: CurrentSettings, seed: int) -> None:
        """Starts at the mean.

        Args:
            seed: [-] 0 or more.
        """
        self._mean = (settings.north, settings.east)
        self._keep = exp(-HELD / settings.time_constant)
        push = settings.std * sqrt(1.0 - self._keep**2)
        self._noise = white_noise(seed, CURRENT, [push, push])
        self._steady = settings.std == 0.0
        self._off = (0.0, 0.0)  # [m/s] from the mean
        self._until = HELD  # [s]

    def at(self, seconds: float) -> Vec3:
        """[m/s] NED, `seconds` after the start; must not decrease between calls."""
        while seconds >= self._until and not self._steady:
            (a, b), (x, y) = next(self._noise), self._off
            self._off = self._keep * x + a, self._keep * y + b
            self._until += HELD
        return self._mean[0] + self._off[0], self._mean[1] + self._off[1], 0.0
