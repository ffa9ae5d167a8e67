"""The tether's drag on the vehicle, the more of it the deeper the vehicle is.

The tether hangs about upright between ship and vehicle. Of the drag across it, half is carried at
each end. A length L across a flow v has the drag of a cylinder, ½ ρ C_d d L |v| v (Morison's drag
term; C_d of a cylinder 1.2, Hoerner 1965, p. 3-9), so the vehicle feels

    F = −¼ ρ C_d d L |v| v      horizontally, L = depth + slack,

and lengthwise, where the tether slides along itself, a small share of that. v is the vehicle's
velocity through the water. Its mass, its weight in water (about none) and its shape are left out.
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
