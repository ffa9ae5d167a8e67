"""Iron on the compass: what the navigation heading does, and that control never notices."""

from collections import Counter
from math import cos, hypot, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.attitude.gyroscope import RestingBias
from services.estimation.attitude.heading import wrapped
from services.marine.vehicle import GRAVITY
from tests.support import heading_runs as runs

REST: Vec3 = (0.0, 0.0, -GRAVITY)
EARTH: Vec3 = (15e-6, 0.0, 49e-6)  # [T] NED; 51 µT, dip 73°
TICK = 10_000_000  # [ns]
LARGEST = 0.1  # [rad/s] a mean rate beyond it is a turn


class Sail:
    """A level vehicle without sensor noise, that turns while iron comes and goes."""

    def __init__(self, settings: AttitudeSettings | None = None, agreed: bool = True) -> None:
        self.observer = AttitudeObserver(settings or AttitudeSettings(), (0.0, 0.0, 0.0), 0.0, 0.0)
        self.observer.start(REST)
        self.k, self.heading = 0, 0.0
        self.counts: Counter[str] = Counter()
        self.worst = 0.0  # [rad] error of the navigation heading
        if agreed:
            assert self.observer.agree(0, EARTH)

    def run(self, seconds: float, iron: Vec3 = (0.0, 0.0, 0.0), turn: float = 0.2) -> None:
        for _ in range(round(seconds * 100)):
            self.k += 1
            self.heading += turn * 0.01
            self.observer.step((0.0, 0.0, turn), REST, 0.01)
            n, e, d = (a + b for a, b in zip(EARTH, iron, strict=True))
            c, s = cos(self.heading), sin(self.heading)
            event = self.observer.magnetometer((c * n + s * e, c * e - s * n, d), self.k * TICK)
            self.counts[event.name if event else ""] += 1
            self.worst = max(self.worst, abs(self.error()))

    def error(self) -> float:
        """[rad] Zero while the navigation heading is not known."""
        estimate = self.observer.estimates(True, self.k * TICK).heading_navigation
        return 0.0 if estimate is None else wrapped(estimate.value - self.heading)


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
    assert sail.observer.control.heading == pytest.approx(sail.heading, abs=1e-3)


def test_a_disturbance_is_counted_once_per_passage_and_the_compass_holds_off() -> None:
    sail = Sail()
    for passage in (1, 2):
        sail.run(5.0, (0.0, 20e-6, 0.0))
        assert sail.counts["disturbed:sensor/magnetometer"] == passage
        sail.run(2.9)
        assert not sail.observer.compass.field.trusted
        assert sail.observer.compass.field.disturbed
        sail.run(0.2)
        assert sail.observer.compass.field.trusted
        assert not sail.observer.compass.field.disturbed


def test_iron_that_comes_back_within_the_hold_off_is_the_same_passage() -> None:
    sail = Sail()
    for _ in range(4):
        sail.run(1.0, (0.0, 20e-6, 0.0))
        sail.run(2.0)
    assert sail.counts["disturbed:sensor/magnetometer"] == 1
    assert not sail.observer.compass.field.trusted


def test_while_disturbed_the_spread_grows_and_in_the_end_north_is_not_valid() -> None:
    sail = Sail()
    sail.run(1.0)
    before = sail.observer.compass.std
    sail.run(30.0, (0.0, 20e-6, 0.0))
    assert before < sail.observer.compass.std
    sail.run(31.0, (0.0, 20e-6, 0.0))
    estimate = sail.observer.estimates(True, sail.k * TICK).heading_navigation
    assert estimate is not None
    assert not estimate.valid


def test_a_vehicle_calibrated_beside_steel_believes_the_open_sea_in_the_end() -> None:
    sail = Sail(agreed=False)
    # The steel bends north by 45° and the control heading begins there.
    assert sail.observer.agree(0, (15e-6, 15e-6, 40e-6))
    sail.run(119.0)
    assert sail.counts["disturbed:sensor/magnetometer"] == 1
    assert sail.counts["learnt:sensor/magnetometer"] == 0
    sail.run(2.0)
    assert sail.counts["learnt:sensor/magnetometer"] == 1
    assert sail.error() == pytest.approx(0.0, abs=0.01)


def test_with_the_places_field_in_the_settings_steel_is_never_believed() -> None:
    sail = Sail(AttitudeSettings(earth_field=51.2, earth_dip=73.0), agreed=False)
    assert not sail.observer.agree(0, (15e-6, 15e-6, 40e-6))
    sail.run(300.0, (0.0, 20e-6, -5e-6))
    assert sail.observer.estimates(True, sail.k * TICK).heading_navigation is None
    sail.run(3.1)
    assert sail.error() == pytest.approx(0.0, abs=0.01)
    assert sail.observer.estimates(True, sail.k * TICK).heading_navigation is not None


def test_a_field_that_cannot_be_the_earths_is_not_learnt() -> None:
    observer = Sail(agreed=False).observer
    assert not observer.agree(0, (50e-6, 0.0, 70e-6))
    assert observer.estimates(True, 0).heading_navigation is None


def test_a_compass_that_boots_late_is_used_after_the_hold_off() -> None:
    sail = Sail(agreed=False)
    sail.run(2.9)
    assert sail.observer.estimates(True, sail.k * TICK).heading_navigation is None
    sail.run(0.3)
    assert sail.observer.estimates(True, sail.k * TICK).heading_navigation is not None
    assert sail.counts["disturbed:sensor/magnetometer"] == 0
    assert sail.error() == pytest.approx(0.0, abs=0.01)


@pytest.mark.slow
def test_with_sensor_noise_iron_costs_less_than_ten_degrees_and_control_less_than_a_third() -> None:
    flight = runs.dive(50.0)
    iron = runs.passing_iron(len(flight.heading), 25.0, 20.0, 20e-6)
    seen = runs.observed(flight, runs.measured(flight, 2, runs.CLEAN, iron))
    window = slice(2500, 5500)
    assert np.degrees(np.max(np.abs(seen.navigation[window]))) < 10.0
    assert np.degrees(np.max(np.abs(seen.control[window] - seen.control[2500]))) < 0.3


# The gyroscope's bias at rest.


def rest(bias: RestingBias, seconds: float, rate: Vec3, shake: float = 0.001, seed: int = 0) -> int:
    """How often a rest was said to begin."""
    rng, said = np.random.default_rng(seed), 0
    for noise in rng.standard_normal((round(seconds * 100), 6)).tolist():
        a, b, c, d, e, f = noise
        p, q, r = rate
        turned = (p + shake * a, q + shake * b, r + shake * c)
        said += bias.imu(turned, (0.01 * d, 0.01 * e, 0.01 * f - GRAVITY), 0.01) is not None
    return said


def test_at_rest_the_bias_is_learnt_on() -> None:
    bias = RestingBias((0.010, 0.0, 0.0), 3.0, LARGEST)
    rest(bias, 60.0, (0.011, 0.0005, 0.0))
    assert bias.bias == pytest.approx((0.011, 0.0005, 0.0), abs=1e-4)


@pytest.mark.parametrize(("rate", "shake"), [(0.01, 0.001), (0.0005, 0.02)])
def test_a_turn_or_a_shaken_vehicle_teaches_nothing(rate: float, shake: float) -> None:
    bias = RestingBias((0.0, 0.0, 0.0), 10.0, LARGEST)
    assert rest(bias, 30.0, (0.0, 0.0, rate), shake) == 0
    assert bias.bias == (0.0, 0.0, 0.0)


def test_after_motion_rest_counts_only_after_its_time_and_is_said_once() -> None:
    bias = RestingBias((0.0, 0.0, 0.0), 10.0, LARGEST)
    rest(bias, 2.0, (0.0, 0.0, 0.5))
    assert rest(bias, 2.9, (0.001, 0.0, 0.0)) == 0
    assert bias.bias == (0.0, 0.0, 0.0)
    assert rest(bias, 10.0, (0.001, 0.0, 0.0)) == 1
    assert hypot(*bias.bias) > 1e-4


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-0.2, 0.2)] * 3), min_size=1, max_size=30))
def test_the_bias_never_leaves_its_bounds(rates: list[Vec3]) -> None:
    bias = RestingBias((0.0, 0.0, 0.0), 10.0, LARGEST)
    for rate in rates:
        for _ in range(100):
            bias.imu(rate, REST, 0.01)
        assert max(map(abs, bias.bias)) <= LARGEST
