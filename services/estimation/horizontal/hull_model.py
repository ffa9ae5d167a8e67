"""The acceleration in surge and sway expected by the vehicle's model.

Fossen 2011, eq. 6.1 to 6.3 with ν_r, the velocity through the water, in the added mass and the
drag. The current is steady and the same everywhere, and heave, roll and pitch rates are left out:

    (m − X_u̇) a_x = X − (1 + k_x)(X_u + X_uu |u|) u + (A_y − A_x) r v
    (m − Y_v̇) a_y = Y − (1 + k_y)(Y_v + Y_vv |v|) v + (A_y − A_x) r u

where a is the reading of an ideal accelerometer without gravity, A the added mass, and k the share
by which the true damping exceeds the file's. The lift of the hull's wake is added as in
services/marine/hydrodynamics.py.
"""

from collections.abc import Sequence
from typing import NamedTuple

from services.marine.hydrodynamics import wake_fins
from services.marine.vehicle import Vehicle, wrench_per_newton

Pair = tuple[float, float]  # surge, sway
SURGE, SWAY = 0, 1


class ExpectedAcceleration(NamedTuple):
    """An expected acceleration [m/s²] with its derivatives."""

    acceleration: Pair  # [m/s²]
    by_velocity: tuple[Pair, Pair]  # [1/s] ∂a/∂(u, v), row by row
    by_damping: Pair  # [m/s²] ∂a_x/∂k_x, ∂a_y/∂k_y
    curvature: Pair  # [1/m] largest half of a second derivative by velocity


class HullModel:
    def __init__(self, vehicle: Vehicle, wake_share: float) -> None:
        """`wake_share` [-] of the Munk moment is cancelled by the wake, see `wake_fins`."""
        self.thrusters = len(vehicle.thruster)
        self._columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]
        self._linear, self._quadratic = vehicle.linear_damping, vehicle.quadratic_damping
        added = vehicle.added_mass
        self._mass = vehicle.mass + added[SURGE], vehicle.mass + added[SWAY]
        self._turning = added[SWAY] - added[SURGE]  # [kg]
        level = {SURGE, SWAY}
        self._fins = [f for f in wake_fins(vehicle, wake_share) if {f.along, f.across} == level]

    def force(self, thrust: Sequence[float]) -> Pair:
        """[N] In surge and sway, of the thrust [N] of each thruster."""
        surge = sway = 0.0
        for (ahead, aside, *_), newtons in zip(self._columns, thrust, strict=True):
            surge += ahead * newtons
            sway += aside * newtons
        return surge, sway

    def expected(
        self, velocity: Pair, yaw_rate: float, force: Pair, damping: Pair
    ) -> ExpectedAcceleration:
        """
        Args:
            velocity: [m/s] surge and sway through the water.
            yaw_rate: [rad/s].
            force: [N] of the thrusters.
            damping: [-] share by which the damping exceeds the vehicle file's; 0: as there.
        """
        u, v = velocity
        drag = [(self._linear[i] + self._quadratic[i] * abs(velocity[i])) * velocity[i]
                for i in (SURGE, SWAY)]  # fmt: skip
        slope = [self._linear[i] + 2.0 * self._quadratic[i] * abs(velocity[i])
                 for i in (SURGE, SWAY)]  # fmt: skip
        known = [1.0 + damping[SURGE], 1.0 + damping[SWAY]]
        turn = self._turning * yaw_rate
        total = [
            force[SURGE] - known[SURGE] * drag[SURGE] + turn * v,
            force[SWAY] - known[SWAY] * drag[SWAY] + turn * u,
        ]
        by = [[-known[SURGE] * slope[SURGE], turn], [turn, -known[SWAY] * slope[SWAY]]]
        for fin in self._fins:
            along = velocity[fin.along]
            forward = 1.0 if along >= 0.0 else -1.0
            slip = velocity[fin.across] - forward * fin.sign * fin.arm * yaw_rate
            total[fin.across] -= fin.grip * abs(along) * slip
            by[fin.across][fin.along] -= fin.grip * forward * slip
            by[fin.across][fin.across] -= fin.grip * abs(along)
        m, n = self._mass
        bend = [known[i] * self._quadratic[i] for i in (SURGE, SWAY)]
        for fin in self._fins:
            bend[fin.across] += fin.grip
        return ExpectedAcceleration(
            acceleration=(total[SURGE] / m, total[SWAY] / n),
            by_velocity=((by[0][0] / m, by[0][1] / m), (by[1][0] / n, by[1][1] / n)),
            by_damping=(-drag[SURGE] / m, -drag[SWAY] / n),
            curvature=(bend[SURGE] / m, bend[SWAY] / n),
        )
