"""The simulated picture obeys the laws of what it shows."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.camera.sea import (
    CameraView,
    Picture,
    SimulatedSea,
    WaterLight,
)
from services.marine.attitude import from_euler

SIZE, FLOOR = (160, 90), 6.0
CLEAR = SimulatedSea(*SIZE, 1.4, WaterLight(turbidity=0.1), FLOOR)
MURKY = SimulatedSea(*SIZE, 1.4, WaterLight(turbidity=2.0), FLOOR)
DARK = SimulatedSea(*SIZE, 1.4, WaterLight(daylight=0.0), FLOOR)
DOWNWARDS = -pi / 2
angle = st.floats(-pi, pi)
place = st.floats(-50.0, 50.0)


def contrast(picture: Picture) -> float:
    return float(np.std(picture.y))


@given(north=place, east=place, depth=st.floats(-2.0, 9.0), roll=angle, pitch=angle, yaw=angle)
@settings(max_examples=25, deadline=None)
def test_every_view_is_a_picture_in_video_range(
    north: float, east: float, depth: float, roll: float, pitch: float, yaw: float
) -> None:
    """Also upside down, above the surface and below the floor."""
    view = CameraView((north, east, depth), from_euler(roll, pitch, yaw), 0.3, 1.0)
    with np.errstate(invalid="raise", divide="raise", over="raise"):
        y, u, v = CLEAR.draw(view)
    assert y.shape == (90, 160)
    assert u.shape == v.shape == (45, 80)
    assert y.min() >= 16
    assert y.max() <= 235
    assert min(u.min(), v.min()) >= 16


def test_turbid_water_hides_what_there_is() -> None:
    view = CameraView((0.0, 0.0, 4.0), from_euler(0.0, -0.2, 0.5))
    assert contrast(MURKY.draw(view)) < 0.7 * contrast(CLEAR.draw(view))


def test_without_daylight_the_lamp_lights_what_is_near() -> None:
    def light(depth: float, lamp: float) -> float:
        view = CameraView((0.0, 0.0, depth), from_euler(0.0, DOWNWARDS, 0.0), 0.0, lamp)
        return float(np.mean(DARK.draw(view).y))

    assert light(5.0, 0.0) < 20.0 < light(5.0, 0.3)
    assert light(3.0, 0.3) < light(5.0, 0.3)


@pytest.mark.parametrize("daylight", [0.0, 0.6])
def test_the_lamp_never_makes_the_floor_all_white(daylight: float) -> None:
    sea = SimulatedSea(*SIZE, 1.4, WaterLight(0.25, daylight), FLOOR)
    for above, tilt in ((0.5, DOWNWARDS), (2.0, DOWNWARDS), (1.0, -0.5)):
        at = (1.0, 2.0, FLOOR - above)
        lit = sea.draw(CameraView(at, from_euler(0.0, 0.0, 0.3), tilt, 1.0)).y
        assert np.mean(lit >= 230) < 0.08
        assert np.std(lit.astype(float)) > 8.0  # there is something to be seen
        assert np.mean(lit) > 40.0


def test_the_floor_stands_still_while_the_drone_moves() -> None:
    """Moved ahead over the floor by some pixels of its texture, the picture moves as far."""
    focal = 80.0 / np.tan(0.7)
    above = 1.0
    step = 8 * above / focal  # [m] eight pixels of the picture

    def floor(north: float) -> Picture:
        down = from_euler(0.0, DOWNWARDS, 0.0)
        return CLEAR.draw(CameraView((20.0 + north, 40.0, FLOOR - above), down))

    before, after = floor(0.0).y.astype(float), floor(step).y.astype(float)
    moved = np.corrcoef(before[8:-16].ravel(), after[16:-8].ravel())[0, 1]
    still = np.corrcoef(before[8:-16].ravel(), after[8:-16].ravel())[0, 1]
    assert moved > 0.8
    assert moved > still + 0.2


@pytest.mark.parametrize("yaw", [-0.4, 0.0, 0.2])
def test_a_piling_is_seen_where_it_stands(yaw: float) -> None:
    """One stands at (3.5, 2.0) m; 3 m south of it and turned, it is at the bearing of -yaw."""
    view = CameraView((0.5, 2.0, 1.0), from_euler(0.0, 0.0, yaw))
    row = CLEAR.draw(view).y[45].astype(float)
    column = 80.0 - 80.0 / np.tan(0.7) * np.tan(yaw)
    edges = np.abs(np.diff(row))
    near = edges[max(0, int(column) - 14) : int(column) + 14]
    assert near.max() > 8.0
