"""Contact with the sea floor and walls: flat, stiff, damped planes with friction, acting on the
corners of the hull.

The stiffness scales with the vehicle's mass: the hull on its corners is an oscillator of about
FREQUENCY rad/s.
"""

from itertools import product
from math import sqrt

from messages.units import Vec3, Vec6

FREQUENCY = 40.0  # [rad/s] at 1.2 m/s the hull then sinks in about 2 cm
DAMPING_RATIO = 0.7  # [-] little rebound
FRICTION = 0.5  # [-] Coulomb, a hull on sand or clay; assumed


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
