"""Vehicles in the water: `services/simulator/vessel.py` in lanes, with sea floor, walls and tether,
without current and waves.

The equations of motion are those of the simulator. Its function is called for a deep vehicle; what
a hull that is partly in the air lacks of buoyancy is a wrench beside the thrust.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from services.marine.attitude import attitude_rate, down_in_body, from_euler, to_body, to_world
from services.marine.hydrodynamics import full_buoyancy, system_inertia
from services.marine.vehicle import Vehicle
from services.marine.water import density_of
from services.simulator.settings import Settings
from services.simulator.surroundings import EAST, FRICTION, LENGTHWISE, NORTH, Barrier, sea_floor
from services.simulator.vessel import STEP, STEP_AT_BARRIER, equations_of_motion
from tools.sweep.fast.lanes import Lanes, Lanes3, Lanes6, unit, where
from tools.sweep.fast.thrusters import Thrusters


class LaneBarrier(Barrier):
    """A barrier that pushes lanes."""

    def near(self, place: Any) -> Any:
        return place + self._reach > self._limit

    def push(self, place: Any, towards_B: Any, nu: Any) -> Any:
        """Wrench [N, N m] on each hull. Arguments as of the scalar law."""
        u, v, w, p, q, r = nu
        a, b, c = towards_B
        total = [0.0] * 6
        for corner in self._corners:
            sunk = self._sunk(corner, place, towards_B)
            touches = sunk > 0.0
            if not np.any(touches):
                continue
            x, y, z = corner
            # Spring and damper that never pull, and friction along the plane.
            cu, cv, cw = u + q * z - r * y, v + r * x - p * z, w + p * y - q * x
            sinking = a * cu + b * cv + c * cw
            push = np.maximum(0.0, self._stiffness * sunk + self._damping * sinking) * touches
            cu, cv, cw = cu - sinking * a, cv - sinking * b, cw - sinking * c
            sliding = np.sqrt(cu * cu + cv * cv + cw * cw)
            most = FRICTION * push / where(sliding > 0.0, sliding, 1.0)
            grip = np.minimum(self._damping, most) * (sliding > 0.0)
            i, j, k = -push * a - grip * cu, -push * b - grip * cv, -push * c - grip * cw
            parts = i, j, k, y * k - z * j, z * i - x * k, x * j - y * i
            total = [before + part for before, part in zip(total, parts, strict=True)]
        return tuple(total)


class Vessels:
    """`thrusters` take the inputs."""

    def __init__(self, vehicle: Vehicle, place: Settings, count: int) -> None:
        """At rest at the surface, as `at_the_surface`."""
        zero, one = np.zeros(count), np.ones(count)
        self.position: Lanes3 = (zero, zero, vehicle.floating_depth * one)  # [m] NED
        w, x, y, z = from_euler(0.0, 0.0, place.start_heading)
        self.attitude = unit(w * one, x * one, y * one, z * one)  # q_NB
        self.velocity: Lanes6 = (zero,) * 6  # [m/s, rad/s] FRD
        self.thrusters = Thrusters(vehicle, count)
        self._vehicle = vehicle
        self._derivative = equations_of_motion(vehicle, place.wake_share)
        self._buoyancy, self._arm = full_buoyancy(vehicle), vehicle.metacentric_height
        self._height = vehicle.size[2]
        places = [thruster.position for thruster in vehicle.thruster]
        self._places = np.array(places)[:, :, None]
        self._always_wet_below = max(sum(map(abs, position)) for position in places)
        # Floor, walls and tether.
        heave = system_inertia(vehicle)[2]
        sides = [sea_floor(place).plane((0.0, 0.0, 0.0))]
        if (walls := place.walls) is not None:
            sides += [(NORTH, walls.north[1]), ((-1.0, 0.0, 0.0), -walls.north[0])]
            sides += [(EAST, walls.east[1]), ((0.0, -1.0, 0.0), -walls.east[0])]
        self._sides = [(way, LaneBarrier(limit, vehicle.size, heave)) for way, limit in sides]
        self._slack, self._drag = 0.0, 0.0  # [m], [N s²/m³]
        if (tether := place.tether) is not None:
            density = density_of(place.water_density)
            self._slack = tether.slack
            self._drag = 0.25 * density * tether.drag_coefficient * tether.diameter
        self._look_around()

    @property
    def acceleration(self) -> Lanes6:
        """[m/s², rad/s²] As seen in the turning body frame."""
        return self._nu_dot

    def advance(self, seconds: float) -> None:
        steps = int(seconds / STEP - 1e-9) + 1
        h = seconds / steps
        parts = int(h / STEP_AT_BARRIER - 1e-9) + 1
        for _ in range(steps):
            if not self._any_near:
                self._step(h)
                continue
            near = self._near  # these in shorter steps, the others in one and then not any more
            for part in range(parts):
                self._step(where(near, h / parts, h if part == 0 else 0.0))

    def _step(self, h: Any) -> None:
        """The explicit midpoint rule."""
        half, nu, q = 0.5 * h, self.velocity, self.attitude
        x, y, z = self.position
        # To the middle, by the slope at the beginning.
        middle_nu = _ahead(nu, half, self._nu_dot)
        middle_q = _ahead(q, half, attitude_rate(q, nu[3:]))
        north, east, down = to_world(q, nu[:3])
        middle = x + half * north, y + half * east, z + half * down
        # Across the whole step, by the slope in the middle.
        slope = self._slope(half, middle, middle_q, middle_nu)
        north, east, down = to_world(middle_q, middle_nu[:3])
        self.position = x + h * north, y + h * east, z + h * down
        self.attitude = unit(*_ahead(q, h, attitude_rate(middle_q, middle_nu[3:])))
        self.velocity = _ahead(nu, h, slope)
        self.thrusters.age = self.thrusters.age + h
        self._look_around()

    def _slope(self, ahead: Any, position: Lanes3, q: Any, nu: Any) -> Lanes6:
        """dν/dt with the thrust `ahead` [s] from now."""
        tau: Any = tuple(self.thrusters.wrench(ahead))
        if self._any_near:
            for way, barrier in self._sides:
                tau = _sum(tau, barrier.push(_along(way, position), to_body(q, way), nu))
        if self._drag:
            tau = _sum(tau, self._tether_pull(position[2], q, nu))
        dry = np.clip(0.5 - position[2] / self._height, 0.0, 1.0)
        if np.any(dry):
            a, b, c = down_in_body(q)
            lost = dry * self._buoyancy
            m = lost * self._arm
            tau = _sum(tau, (lost * a, lost * b, lost * c, m * b, -m * a, 0.0))
        return self._derivative(np.inf, q, nu, tau)

    def _tether_pull(self, depth: Lanes, q: Any, nu: Any) -> Lanes6:
        north, east, down = to_world(q, nu[:3])
        drag = self._drag * (np.maximum(0.0, depth) + self._slack)
        across = drag * np.hypot(north, east)
        pull = -across * north, -across * east, -drag * LENGTHWISE * np.abs(down) * down
        return *to_body(q, pull), 0.0, 0.0, 0.0

    def _look_around(self) -> None:
        near = [barrier.near(_along(way, self.position)) for way, barrier in self._sides]
        self._near = np.any(near, axis=0)
        self._any_near = bool(np.any(self._near))
        depth = self.position[2]
        if np.any(depth < self._always_wet_below):
            down = np.array(down_in_body(self.attitude))
            self.thrusters.leave_water(depth + np.sum(self._places * down, axis=1) >= 0.0)
        self._nu_dot = self._slope(0.0, self.position, self.attitude, self.velocity)


def _along(way: Sequence[float], position: Lanes3) -> Lanes:
    return way[0] * position[0] + way[1] * position[1] + way[2] * position[2]


def _ahead(values: Any, time: Any, slope: Any) -> Any:
    return tuple([value + time * rate for value, rate in zip(values, slope, strict=True)])


def _sum(a: Any, b: Any) -> Any:
    return tuple([x + y for x, y in zip(a, b, strict=True)])
