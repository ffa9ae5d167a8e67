"""Metres north and east of an origin, against the way over the axes of the earth."""

from math import cos, hypot, radians, sin, sqrt

from hypothesis import given
from hypothesis import strategies as st

from services.instruments.fixes import ECCENTRICITY2, SEMI_MAJOR, GeoPoint, north_east
from tests.support.instruments.truth import latitude_longitude


def earth(place: GeoPoint) -> tuple[float, float, float]:
    """[m] ECEF of a point on the ellipsoid."""
    phi, lam = map(radians, place)
    n = SEMI_MAJOR / sqrt(1.0 - ECCENTRICITY2 * sin(phi) ** 2)
    z = n * (1.0 - ECCENTRICITY2) * sin(phi)
    return n * cos(phi) * cos(lam), n * cos(phi) * sin(lam), z


def tangent(origin: GeoPoint, place: GeoPoint) -> tuple[float, float]:
    """[m] North and east in the plane that touches the earth at the origin."""
    x, y, z = (p - o for p, o in zip(earth(place), earth(origin), strict=True))
    phi, lam = map(radians, origin)
    north = -sin(phi) * cos(lam) * x - sin(phi) * sin(lam) * y + cos(phi) * z
    return north, -sin(lam) * x + cos(lam) * y


@given(
    st.floats(-70.0, 70.0),
    st.floats(-180.0, 180.0),
    st.floats(-1_000.0, 1_000.0),
    st.floats(-1_000.0, 1_000.0),
)
def test_within_a_kilometre_it_is_off_by_less_than_half_a_metre(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    origin = (latitude, longitude)
    place = latitude_longitude(origin, north, east)
    found, true = north_east(origin, *place), tangent(origin, place)
    assert hypot(found[0] - true[0], found[1] - true[1]) < 0.5


def test_the_date_line_is_no_border() -> None:
    assert abs(north_east((0.0, 179.9999), 0.0, -179.9999)[1]) < 23.0
