"""The sea floor: a plane that may slope, and hills on it.

Hills are a sum of WAVES waves of random directions and phases, so that the floor has no period.
"""

from math import cos, pi, sin, sqrt
from typing import Annotated

import msgspec
import numpy as np

from messages.units import Vec3
from services.simulator.streams import TERRAIN

WAVES = 12  # [-] of which the hills are made


class Terrain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What rises and falls beside the slope. Where the vehicle starts, it adds nothing."""

    hills: Annotated[float, msgspec.Meta(ge=0.0, le=50.0)] = 1.0  # [m] standard deviation
    length: Annotated[float, msgspec.Meta(ge=2.0, le=1000.0)] = 20.0  # [m] from hill to hill


class SeaFloor:
    def __init__(
        self,
        depth: float,
        slope: tuple[float, float],
        terrain: Terrain | None = None,
        seed: int = 0,
    ) -> None:
        """
        Args:
            depth: [m] where the vehicle starts.
            slope: [-] by which it falls away to the north, to the east.
            seed: [-] 0 or more, of the hills.
        """
        self._depth, (self._north, self._east) = depth, slope
        self._waves: list[tuple[float, float, float, float]] = []  # [m], [rad/m] twice, [rad]
        self._start = 0.0
        if terrain is None:
            return
        rng = np.random.default_rng([seed, TERRAIN])
        height = terrain.hills * sqrt(2.0 / WAVES)
        for way, phase, longer in rng.random((WAVES, 3)).tolist():
            number = 2.0 * pi / (terrain.length * 2.0 ** (longer - 0.5))
            a, b = number * cos(2.0 * pi * way), number * sin(2.0 * pi * way)
            self._waves.append((height, a, b, 2.0 * pi * phase))
        self._start = self._hills(0.0, 0.0)[0]

    @property
    def rough(self) -> bool:
        return bool(self._waves)

    def depth(self, place: Vec3) -> float:
        """[m] At a place [m] NED."""
        below = self._depth + self._north * place[0] + self._east * place[1]
        if self._waves:
            below += self._hills(place[0], place[1])[0] - self._start
        return below

    def plane(self, place: Vec3) -> tuple[Vec3, float]:
        """That which touches the floor at a place [m] NED: the direction [-] NED that leads into it
        at a right angle, and how far it is in that direction [m]."""
        a, b, depth = self._north, self._east, self._depth
        if self._waves:
            _, c, d = self._hills(place[0], place[1])
            a, b = a + c, b + d
            depth = self.depth(place) - a * place[0] - b * place[1]
        size = sqrt(1.0 + a**2 + b**2)
        return (-a / size, -b / size, 1.0 / size), depth / size

    def _hills(self, north: float, east: float) -> tuple[float, float, float]:
        """[m] How much deeper, and [-] how fast that grows to the north and to the east."""
        deeper = to_north = to_east = 0.0
        for height, a, b, phase in self._waves:
            angle = a * north + b * east + phase
            deeper += height * sin(angle)
            slope = height * cos(angle)
            to_north, to_east = to_north + a * slope, to_east + b * slope
        return deeper, to_north, to_east
