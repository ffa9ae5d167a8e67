"""What stands in for hardware here: a damped mass that never tilts, with sensors and ESCs.

A real driver has a serial port or a bus of chips in this place.
"""

from collections.abc import Sequence
from math import cos, sin
from random import Random

from lindy.api.messages import Vec3
from lindy.api.service import OpenLoopThrust
from lindy.api.vehicle import (
    ATMOSPHERE,
    GRAVITY,
    SEA_WATER,
    Vehicle,
    share_of_voltage,
    system_inertia,
    total_wrench,
    wrench_per_newton,
)

FIELD = (15e-6, 49e-6)  # [T] of the Earth, north and down
AXES = (0, 1, 2, 5)  # surge, sway, heave, yaw; roll and pitch stay zero


class Hardware:
    def __init__(self, vehicle: Vehicle, noise: float, seed: int) -> None:
        """
        Args:
            noise: [-] times that of usual sensors.
        """
        self.shares = [0.0] * len(vehicle.thruster)  # [-] of the voltage, what the ESCs are told
        self._vehicle, self._inertia = vehicle, system_inertia(vehicle)
        self._columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]
        self._propellers = OpenLoopThrust(vehicle.thruster)
        self._noise, self._gauss = noise, Random(seed).gauss
        self._depth, self._heading = vehicle.floating_depth, 0.0  # [m], [rad]
        self._velocity = self._acceleration = [0.0] * 6  # [m/s, rad/s] FRD and its derivative
        self._now = 0  # [ns]

    def write_escs(self, thrust: Sequence[float], now: int) -> None:
        """[N] Per thruster, from now [ns] on."""
        pairs = zip(self._vehicle.thruster, thrust, strict=True)
        self.shares = [share_of_voltage(thruster, newtons) for thruster, newtons in pairs]
        self._propellers.drive(thrust, now)

    def move(self, now: int) -> None:
        """The water goes on to `now` [ns]."""
        dt, self._now = min(0.1, (now - self._now) / 1e9), now
        force = list(total_wrench(self._columns, self._propellers.believed(now)))
        force[2] -= self._buoyancy()
        for k in AXES:
            v, about = self._velocity[k], self._vehicle
            drag = (about.linear_damping[k] + about.quadratic_damping[k] * abs(v)) * v
            self._acceleration[k] = (force[k] - drag) / self._inertia[k]
        self._velocity = [
            v + dt * a for v, a in zip(self._velocity, self._acceleration, strict=True)
        ]
        self._heading += dt * self._velocity[5]
        self._depth += dt * self._velocity[2]

    def _buoyancy(self) -> float:
        """[N] Upwards, more than its weight; less where a part of it is out of the water."""
        about = self._vehicle
        per_metre = about.mass * GRAVITY / about.size[2]  # [N/m]
        out = about.floating_depth + about.net_buoyancy / per_metre - self._depth  # [m]
        return about.net_buoyancy - per_metre * max(0.0, out)

    def specific_force(self) -> Vec3:
        """[m/s²] FRD; at rest 0, 0, -g."""
        u, v, _, _, _, r = self._velocity
        a, b, c, *_ = self._acceleration
        return self._shaken((a - r * v, b + r * u, c - GRAVITY), 0.015)

    def angular_rate(self) -> Vec3:
        """[rad/s] FRD."""
        return self._shaken((0.0, 0.0, self._velocity[5]), 0.001)

    def field(self) -> Vec3:
        """[T] FRD."""
        north, down = FIELD
        return self._shaken((north * cos(self._heading), -north * sin(self._heading), down), 2e-7)

    def pressure(self) -> float:
        """[Pa] absolute."""
        water = SEA_WATER * GRAVITY * max(0.0, self._depth)
        return ATMOSPHERE + water + self._gauss(0.0, 100.0 * self._noise)

    def power(self) -> float:
        """[W]"""
        return 20.0 + 300.0 * sum(abs(share) ** 1.5 for share in self.shares)

    def _shaken(self, vector: Vec3, std: float) -> Vec3:
        x, y, z = (value + self._gauss(0.0, std * self._noise) for value in vector)
        return x, y, z
