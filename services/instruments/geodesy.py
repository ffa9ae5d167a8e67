"""Latitude and longitude as metres north and east of an origin, on the ellipsoid WGS 84.

With the radii of curvature at the origin (Farrell 2008, Aided Navigation, eq. 2.5 and 2.6): below
70° of latitude they are off by 0.25 m at a distance of 1 km, and by the square of it beyond.
"""

from math import cos, radians, sin, sqrt
from typing import Annotated

import msgspec

SEMI_MAJOR = 6_378_137.0  # [m]
ECCENTRICITY2 = 6.694379990141e-3  # [-] squared
Latitude = Annotated[float, msgspec.Meta(ge=-89.0, le=89.0)]  # [deg] + is north
Longitude = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]  # [deg] + is east
GeoPoint = tuple[Latitude, Longitude]  # [deg]


def is_on_earth(latitude: float, longitude: float) -> bool:
    """Can it be a position? (0, 0) is what a receiver without one says."""
    if latitude == longitude == 0.0:
        return False
    return abs(latitude) <= 89.0 and abs(longitude) <= 180.0


def north_east(origin: GeoPoint, latitude: float, longitude: float) -> tuple[float, float]:
    """[m] North and east of the origin."""
    sine = sin(radians(origin[0]))
    w = 1.0 - ECCENTRICITY2 * sine * sine
    meridian = SEMI_MAJOR * (1.0 - ECCENTRICITY2) / (w * sqrt(w))
    parallel = SEMI_MAJOR / sqrt(w) * cos(radians(origin[0]))
    east = (longitude - origin[1] + 180.0) % 360.0 - 180.0
    return meridian * radians(latitude - origin[0]), parallel * radians(east)
