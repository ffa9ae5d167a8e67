"""Iron on the compass: what the navigation heading does, and that control never notices."""

from collections import Counter
from math import atan2, cos, hypot, pi, radians, remainder, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from services.estimation.compass import Compass
from services.estimation.filter import GYRO, TILT, ErrorStateFilter, to_world
from services.estimation.rest import Rest
from services.estimation.settings import AttitudeSettings, CalibrationSettings
from services.marine.vehicle import GRAVITY

REST: Vec3 = (0.0, 0.0, -GRAVITY)
STILL = (0.0, 0.0, 0.0)
EARTH: Vec3 = (15e-6, 0.0, 49e-6)  # [T] NED; 51 µT, dip 73°
TICK = 10_000_000  # [ns]
LARGEST = 0.1  # [rad/s] a mean rate beyond it is a turn


class Sail:
    """A level vehicle without sensor noise, that turns while iron comes and goes."""

    def __init__(self, settings: AttitudeSettings | None = None, agreed: bool = True) -> None:
        self.compass, self.filter = Compass(settings or AttitudeSettings()), ErrorStateFilter()
        for k in range(3):
            self.filter.forget(TILT + k, 0.01 if k < 2 else 1e-3)
            self.filter.forget(GYRO + k, 7e-5)
        self.k, self.heading = 0, 0.0
        self.counts: Counter[str] = Counter()
        self.worst = 0.0  # [rad] error of the navigation heading
        if agreed:
            assert self.agree(EARTH)

    def agree(self, field: Vec3) -> bool:
        """Calibrate in this field [T], FRD."""
        n, e, d = to_world(self.filter.rotation, field)
        if not self.compass.learn(1e6 * hypot(n, e, d), atan2(d, hypot(n, e))):
            return False
        self.filter.turn_to(-atan2(e, n), 1e-3)
        self.compass.take_north(self.filter, to_world(self.filter.rotation, field))
        return True

    def run(self, seconds: float, iron: Vec3 = (0.0, 0.0, 0.0), turn: float = 0.2) -> None:
        for _ in range(round(seconds * 100)):
            self.k += 1
            self.heading += turn * 0.01
            self.filter.predict(REST, (0.0, 0.0, turn), 0.01, (0.0, 0.0))
            n, e, d = (a + b for a, b in zip(EARTH, iron, strict=True))
            c, s = cos(self.heading), sin(self.heading)
            field = (c * n + s * e, c * e - s * n, d)
            event = self.compass.fuse(self.filter, field, self.k * TICK)
            self.counts[event.name if event else ""] += 1
            self.worst = max(self.worst, abs(self.error()))

    def error(self) -> float:
        """[rad] Zero while the navigation heading is not known."""
        if not self.compass.knows_north:
            return 0.0
        return remainder(self.filter.heading + self.filter.north - self.heading, 2.0 * pi)

    @property
    def spread(self) -> float:
        """[rad]"""
        return self.compass.north_std(self.filter)


@settings(max_examples=25, deadline=None)
@given(st.floats(5e-6, 40e-6), st.floats(-pi, pi), st.floats(-1.5, 1.5))
def test_any_iron_for_twenty_seconds_costs_no_more_than_the_gate(
    strength: float, azimuth: float, steepness: float
) -> None:
    level = strength * cos(steepness)
    iron = (level * cos(azimuth), level * sin(azimuth), strength * sin(steepness))
    sail = Sail()
    sail.run(2.0)
    sail.run(10.0, iron)
    sail.run(5.0)
    assert sail.worst < radians(10.0)
    assert sail.filter.heading == pytest.approx(sail.heading, abs=1e-3)


def test_a_disturbance_is_counted_once_per_passage_and_the_compass_holds_off() -> None:
    sail = Sail()
    for passage in (1, 2):
        for _ in range(3):  # iron that comes back within the hold-off
            sail.run(1.0, (0.0, 20e-6, 0.0))
            sail.run(2.0)
        assert sail.counts["disturbed:sensor/magnetometer"] == passage
        sail.run(0.8)
        assert sail.compass.disturbed
        sail.run(0.4)
        assert not sail.compass.disturbed


def test_while_disturbed_the_spread_grows_and_in_the_end_north_is_not_valid() -> None:
    sail = Sail()
    sail.run(1.0)
    before = sail.spread
    sail.run(30.0, (0.0, 20e-6, 0.0))
    assert before < sail.spread
    assert sail.compass.is_recent(sail.k * TICK)
    sail.run(31.0, (0.0, 20e-6, 0.0))
    assert not sail.compass.is_recent(sail.k * TICK)


def test_a_vehicle_calibrated_beside_steel_takes_the_open_sea_for_normal_in_the_end() -> None:
    sail = Sail(agreed=False)
    # The steel bends north by 45° and the control heading begins there.
    assert sail.agree((15e-6, 15e-6, 40e-6))
    sail.run(119.0)
    assert sail.counts["disturbed:sensor/magnetometer"] == 1
    assert sail.counts["learnt:sensor/magnetometer"] == 0
    sail.run(2.0)
    assert sail.counts["learnt:sensor/magnetometer"] == 1
    assert sail.error() == pytest.approx(0.0, abs=0.01)


def test_without_a_field_that_can_be_the_earths_it_is_used_after_the_hold_off() -> None:
    sail = Sail(agreed=False)
    assert not sail.agree((50e-6, 0.0, 70e-6))
    sail.run(2.8)
    assert not sail.compass.knows_north
    sail.run(0.5)
    assert sail.compass.knows_north
    assert sail.counts["disturbed:sensor/magnetometer"] == 0
    assert sail.error() == pytest.approx(0.0, abs=0.02)


# The gyroscope's bias at rest.


def bench() -> tuple[ErrorStateFilter, Rest]:
    f = ErrorStateFilter()
    for k in range(3):
        f.forget(GYRO + k, 1e-3)
    rest = Rest(CalibrationSettings(largest_bias=LARGEST))
    rest.calibrates = False
    return f, rest


def lie(
    f: ErrorStateFilter,
    rest: Rest,
    seconds: float,
    rate: Vec3,
    shake: float = 0.001,
    *,
    push: bool = False,
) -> int:
    """How often a rest was said to begin."""
    rng, said = np.random.default_rng(0), 0
    for n, noise in enumerate(rng.standard_normal((round(seconds * 100), 6)).tolist()):
        a, b, c, d, e, g = noise
        p, q, r = rate
        turned = (p + shake * a, q + shake * b, r + shake * c)
        if push:
            rest.pushed()
        force = (0.01 * d, 0.01 * e, 0.01 * g - GRAVITY)
        if rest.imu(force, turned, 0.01):
            said += rest.fuse(f, n * TICK, driven=False) is not None
    return said


def test_at_rest_the_bias_is_measured_after_its_time_and_said_once() -> None:
    f, rest = bench()
    lie(f, rest, 2.0, (0.0, 0.0, 0.5))
    assert lie(f, rest, 2.9, (0.0011, 0.0005, 0.0)) == 0
    assert f.gyro_bias == (0.0, 0.0, 0.0)
    assert lie(f, rest, 60.0, (0.0011, 0.0005, 0.0)) == 1
    assert f.gyro_bias == pytest.approx((0.0011, 0.0005, 0.0), abs=1e-4)


@pytest.mark.parametrize(
    ("rate", "shake", "push"), [(0.2, 1e-3, False), (5e-4, 0.02, False), (5e-4, 1e-3, True)]
)
def test_a_turn_or_a_shaken_or_a_pushed_vehicle_teaches_nothing(
    rate: float, shake: float, push: bool
) -> None:
    f, rest = bench()
    assert lie(f, rest, 30.0, (0.0, 0.0, rate), shake, push=push) == 0
    assert f.gyro_bias == (0.0, 0.0, 0.0)
