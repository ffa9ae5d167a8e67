"""How thrust moves a hull through the water along its own axes.

With ν the velocity through the water and the angular rate, and τ the thrust,

    M ν̇ = τ - C(ν) ν - D(ν) ν + lift                 (Fossen 2011, eq. 6.1 to 6.3)

Weight and buoyancy are left out: who uses this learns them otherwise. A steady current changes
nothing.
"""

from messages.units import Vec3, Vec6
from services.marine.hydrodynamics import damping
from services.marine.rigid_body import coriolis, system_inertia
from services.marine.vehicle import Vehicle
from services.marine.wake import wake_fins, wake_lift


class Translation:
    def __init__(self, vehicle: Vehicle, wake_share: float) -> None:
        """
        Args:
            vehicle: of the vehicle file.
            wake_share: [-] of the Munk moment that the wake cancels, see `wake_fins`.
        """
        self.inertia = system_inertia(vehicle)
        self._linear, self._quadratic = vehicle.linear_damping, vehicle.quadratic_damping
        self._fins = wake_fins(vehicle, wake_share)

    def acceleration(self, nu: Vec6, thrust: Vec6) -> Vec3:
        """[m/s²] ν̇ of a vehicle without weight and buoyancy.

        Args:
            nu: [m/s, rad/s] ν.
            thrust: [N, N m] τ.
        """
        turned = coriolis(self.inertia, nu)
        drag = damping(self._linear, self._quadratic, nu)
        lift = wake_lift(self._fins, nu)
        x, y, z = [(thrust[k] - turned[k] - drag[k] + lift[k]) / self.inertia[k] for k in range(3)]
        return x, y, z


def flow(surge: float, sway: float, depth_rate: float, down: Vec3, rate: Vec3) -> Vec6:
    """ν [m/s, rad/s], with the heave velocity that belongs to a depth rate.

    Args:
        surge, sway: [m/s] through the water.
        depth_rate: [m/s].
        down: [-] the world's down axis in body axes; its third part is not zero.
        rate: [rad/s] in body axes.
    """
    a, b, c = down
    return surge, sway, (depth_rate - a * surge - b * sway) / c, *rate
