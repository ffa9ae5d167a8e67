"""What is drawn into a film fits the picture, by its pixels."""

from math import cos, radians, sin, tan

import numpy as np
import pytest

pytest.importorskip("av")
pytest.importorskip("PIL")

from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image

from services.marine.attitude import from_euler, to_world
from services.marine.field_of_view import FieldOfView
from tools.log.film_overlay import LADDER, draw
from tools.log.film_scenes import FilmPlace

SIZE = WIDTH, HEIGHT = 640, 360  # [px]
SKY = HEIGHT // 5 + 8  # [px] above it are heading and tape
angles = st.floats(-0.35, 0.35)


def drawn(drone: FilmPlace, view: FieldOfView | None, size: tuple[int, int] = SIZE) -> np.ndarray:
    image = Image.new("RGB", size, (90, 90, 90))
    draw(image, drone, view)
    return np.asarray(image.convert("L"))


def pixel(
    drone: FilmPlace, view: FieldOfView, elevation: float, aside: float
) -> tuple[float, float]:
    """Where a pinhole camera sees what lies in this direction [rad], `aside` of its axis."""
    q = from_euler(drone.roll or 0.0, drone.pitch or 0.0, 0.0)
    c, s = cos(view.tilt + drone.tilt), sin(view.tilt + drone.tilt)
    a, b = cos(view.yaw), sin(view.yaw)
    axes = [to_world(q, v) for v in ((c * a, c * b, -s), (-b, a, 0.0), (s * a, s * b, c))]
    azimuth = np.arctan2(axes[0][1], axes[0][0]) + aside
    e = cos(elevation)
    there = e * cos(azimuth), e * sin(azimuth), -sin(elevation)
    ahead, right, below = (float(np.dot(axis, there)) for axis in axes)
    focal = WIDTH / 2 / tan(view.angle / 2)
    return WIDTH / 2 + focal * right / ahead, HEIGHT / 2 + focal * below / ahead


def is_white(seen: np.ndarray, x: float, y: float) -> bool:
    near = seen[max(0, round(y) - 1) : round(y) + 3, max(0, round(x) - 1) : round(x) + 3]
    return bool(near.max() > 240)


@given(angles, angles, angles, st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(0.8, 1.8))
@example(0.1, 0.2, 0.0, -0.3, 0.0, 1.4)
def test_the_horizon_is_where_the_camera_sees_it(
    roll: float, pitch: float, tilt: float, mounted: float, yaw: float, angle: float
) -> None:
    drone = FilmPlace(0, 1.0, None, roll=roll, pitch=pitch, tilt=tilt)
    view = FieldOfView(angle, mounted, yaw)
    seen = drawn(drone, view)
    for aside in (-0.12, -0.06, 0.06, 0.12):
        x, y = pixel(drone, view, 0.0, aside)
        if SKY < y < 0.8 * HEIGHT and 0 < x < WIDTH and abs(y - HEIGHT / 2) > 20:
            assert is_white(seen, x, y)


@pytest.mark.parametrize("degrees", [each for each in LADDER if abs(each) <= 10])
def test_the_ladder_has_its_elevations(degrees: int) -> None:
    drone, view = FilmPlace(0, 1.0, None, roll=0.2, pitch=0.0), FieldOfView(1.4)
    x, y = pixel(drone, view, radians(degrees), 0.0)
    assert is_white(drawn(drone, view), x, y)


def test_what_is_abeam_is_there_on_the_tape() -> None:
    """A mark each 5°, at the tangent of its angle."""
    view = FieldOfView(1.4)
    seen = drawn(FilmPlace(0, 1.0, 100.0), view)
    row = seen[HEIGHT // 40 + HEIGHT // 12 + 2]
    found = np.flatnonzero(row == 255)
    focal = WIDTH / 2 / tan(view.angle / 2)
    for degrees in (-25, -20, -15, 15, 20, 25):
        assert np.abs(found - (WIDTH / 2 + focal * tan(radians(degrees)))).min() <= 1.0
    between = focal * tan(radians(22.5)) + WIDTH / 2
    assert np.abs(found - between).min() > 5.0


def test_of_a_view_that_is_not_known_there_is_no_horizon() -> None:
    drone = FilmPlace(0, 1.0, 100.0, roll=0.0, pitch=0.3)
    x, y = pixel(drone, FieldOfView(), 0.0, 0.1)
    assert is_white(drawn(drone, FieldOfView()), x, y)
    assert not is_white(drawn(drone, None), x, y)
    level = FilmPlace(0, 1.0, 100.0)
    assert not is_white(drawn(level, FieldOfView()), WIDTH * 0.3, HEIGHT / 2)


@pytest.mark.parametrize("size", [(320, 180), (320, 240), (640, 360), (1920, 1080), (180, 320)])
@pytest.mark.parametrize("far", [1.0, -1234.5])
@pytest.mark.parametrize("mode", ["manual", "station_keeping"])
def test_no_word_is_cut_off_at_the_edge(size: tuple[int, int], far: float, mode: str) -> None:
    drone = FilmPlace(1_764_013_622 * 10**9, 112.3, 263.0, far, far, mode, 18.25)
    seen = drawn(drone, None, size).copy()
    seen[1:-1, 1:-1] = 90
    assert (seen == 90).all()
    without = drawn(drone._replace(water=None), None, size)
    assert (without != drawn(drone, None, size)).any()  # the last one is there
