"""The tether's drag on the vehicle, which grows with depth.

The tether hangs approximately vertically between ship and vehicle; each end carries half of its
transverse drag. A length L across a flow v has the drag of a cylinder, ½ ρ C_d d L |v| v (Morison's
drag term; C_d of a cylinder 1.2, Hoerner 1965, p. 3-9), so the force on the vehicle is

    F = −¼ ρ C_d d L |v| v      horizontally, L = depth + slack,

and vertically, along the tether, a small share of that. v is the vehicle's velocity through the
water. The tether's mass, weight in water (about zero) and shape are neglected.
"""

from math import hypot

from messages.units import Vec3
from services.simulator.settings import TetherSettings

LENGTHWISE = 0.02  # [-] drag along a cable as a share of that across it; typical, assumed


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
