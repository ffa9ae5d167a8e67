"""What the vehicle does, as an instrument sees it."""

from random import Random
from typing import NamedTuple

from messages.units import Vec3
from services.instruments.core import GeoPoint, north_east


class SeenMotion(NamedTuple):
    velocity: Vec3 = (0.0, 0.0, 0.0)  # [m/s] over the ground, in the vehicle's axes
    altitude: float = 2.0  # [m] above the bottom
    north: float = 0.0  # [m]
    east: float = 0.0  # [m]
    depth: float = 1.0  # [m]
    heading: float = 0.0  # [deg]


def drawn(seed: int, t: float, what: str) -> Random:
    """Random numbers of one instant, the same for whoever asks again."""
    return Random(f"{seed} {t:.6f} {what}")


def latitude_longitude(origin: GeoPoint, north: float, east: float) -> GeoPoint:
    """[deg] Of a point [m] north and east of the origin."""
    per_degree = north_east((origin[0], 0.0), origin[0] + 1.0, 1.0)
    return origin[0] + north / per_degree[0], origin[1] + east / per_degree[1]
