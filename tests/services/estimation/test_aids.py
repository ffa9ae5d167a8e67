"""Position and velocity from DVL and USBL, against a truth made here and against the simulator."""

from collections import Counter
from dataclasses import dataclass, field
from math import cos, hypot, sin

import numpy as np
import pytest

from messages import events, topics
from messages.events import Event
from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from messages.units import Vec3
from services.estimation.aids import Aids
from services.estimation.filter import (
    DEPTH,
    DEVIATION,
    FORCE,
    GYRO,
    NORTH,
    POSITION,
    TILT,
    VELOCITY,
    YAW,
    ErrorStateFilter,
)
from services.estimation.quantity import Fusion, Quantity
from services.marine.vehicle import GRAVITY
from tests.support.dive import Dive

S = 1_000_000_000  # [ns]


class Observer:
    """The filter with DVL and fixes."""

    def __init__(self, offset: float) -> None:
        self.filter, self.aids = ErrorStateFilter(), Aids()
        self.filter.north = offset
        for state, std in (
            (TILT, 0.01), (TILT + 1, 0.01), (YAW, 0.002), (GYRO + 2, 1e-4), (NORTH, 0.01),
            (FORCE, 0.1), (FORCE + 1, 0.1), (VELOCITY, 1.0), (VELOCITY + 1, 1.0),
        ):  # fmt: skip
            self.filter.forget(state, std)
        self.filter.forget(DEVIATION, 0.01)

    def predict(self, force: Vec3, rate: Vec3, now: int) -> Event | None:
        self.filter.predict(force, rate, 0.01, (1e-3, 1e-7))
        return self.aids.remember(self.filter, now)

    def dvl(self, sample: DvlSample) -> Event | None:
        return self.aids.dvl(self.filter, sample)

    def usbl(self, sample: UsblSample) -> Event | None:
        return self.aids.usbl(self.filter, sample)

    def estimates(self, now: int) -> dict[str, Estimate]:
        return self.aids.estimates(self.filter, now, with_current=False)

    @property
    def origin(self) -> int | None:
        return self.aids.origin


@dataclass
class Voyage:
    """A level vehicle on a circle: 0.8 m/s, one turn in 63 s; DVL and USBL as asked for."""

    dvl_std: float = 0.01  # [m/s]
    usbl_std: float = 0.5  # [m]
    latency: float = 0.0  # [s] of both
    seed: int = 0
    offset: float = 0.7  # [rad] north, from where the control heading believes it is
    dvl: bool = True
    usbl: bool = True
    spike: float = 0.0  # [m] on the fixes
    fish: float = 0.0  # [m/s] ahead, that the DVL takes for the bottom
    altitude: float | None = None  # [m] as the DVL says it
    every: int = 100  # [10 ms] between two samples of the DVL
    counts: Counter[str] = field(default_factory=Counter[str])
    k: int = 0

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.observer = Observer(self.offset)
        self.observer.filter.turn_to(-self.offset, 0.002)
        self.waiting: list[tuple[int, DvlSample | UsblSample]] = []

    def place(self, t: float) -> tuple[float, float]:
        return 8.0 * sin(0.1 * t), 8.0 * (1.0 - cos(0.1 * t))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.k += 1
            t, now = self.k / 100, self.k * S // 100
            a, b = (0.03 * self.rng.standard_normal(2)).tolist()
            force = (a + 0.02, 0.08 + b, -GRAVITY)  # centripetal, and a small bias
            self.note(self.observer.predict(force, (0.0, 0.0, 0.1), now))
            if self.dvl and self.k % self.every == 0:
                self.waiting.append((now, self.velocity(now)))
            if self.usbl and self.k % 200 == 50:
                self.waiting.append((now, self.fix(t, now)))
            self.deliver(now)

    def velocity(self, now: int) -> DvlSample:
        u, v, w = (self.dvl_std * self.rng.standard_normal(3)).tolist()
        ahead = 0.8 - self.fish + u
        return DvlSample(
            stamp_ns=now, velocity=(ahead, v, w), std=self.dvl_std, altitude=self.altitude
        )

    def fix(self, t: float, now: int) -> UsblSample:
        (x, y), (a, b) = self.place(t), (self.usbl_std * self.rng.standard_normal(2)).tolist()
        return UsblSample(stamp_ns=now, north=x + a + self.spike, east=y + b, std=self.usbl_std)

    def deliver(self, now: int) -> None:
        while self.waiting and now - self.waiting[0][0] >= self.latency * S:
            sample = self.waiting.pop(0)[1]
            if isinstance(sample, DvlSample):
                self.note(self.observer.dvl(sample))
            else:
                self.note(self.observer.usbl(sample))

    def note(self, what: Event | None) -> None:
        if what is not None:
            self.counts[what.name] += 1

    def error(self) -> float:
        """[m]"""
        found = self.observer.estimates(self.k * S // 100)
        x, y = self.place(self.k / 100)
        return hypot(found["north"].value - x, found["east"].value - y)

    def spread(self) -> float:
        """[m] of each axis."""
        return self.observer.estimates(self.k * S // 100)["north"].std

    def valid(self) -> bool:
        north = self.observer.estimates(self.k * S // 100).get("north")
        return north is not None and north.valid


# What the accelerometer says between the sample and now is worth little: the attitude leans.
@pytest.mark.parametrize(
    ("latency", "off", "away"), [(0.0, 0.08, 0.35), (0.1, 0.10, 0.35), (1.5, 0.45, 0.65)]
)
def test_position_and_velocity_are_better_than_a_single_fix_whatever_the_latency(
    latency: float, off: float, away: float
) -> None:
    errors, ratios = list[float](), list[float]()
    for seed in range(4):
        voyage = Voyage(latency=latency, seed=seed)
        voyage.run(40.0)
        errors.append(voyage.error())
        ratios.append(voyage.error() / (2**0.5 * voyage.spread()))
        found = voyage.observer.estimates(voyage.k * S // 100)
        assert found["surge_velocity"].value == pytest.approx(0.8, abs=off)
        assert found["sway_velocity"].value == pytest.approx(0.0, abs=off)
    assert np.sqrt(np.mean(np.square(errors))) < away  # a single fix: 0.71 m
    assert 0.4 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_with_a_dvl_alone_position_wanders_and_its_spread_says_so() -> None:
    voyage = Voyage(usbl=False)
    voyage.run(5.0)
    early = voyage.spread()
    voyage.run(75.0)
    assert voyage.spread() > 2 * early
    assert voyage.valid()
    assert voyage.error() < 3 * voyage.spread() + 1.0  # counted from where the DVL first spoke


def test_a_wild_fix_is_counted_and_rejected_and_fixes_that_stay_elsewhere_are_followed() -> None:
    voyage = Voyage()
    voyage.run(30.0)
    old = UsblSample(stamp_ns=5 * S, north=99.0, east=99.0, std=0.1)
    assert voyage.observer.usbl(old) == events.TOO_OLD("sensor/usbl")
    voyage.spike = 30.0
    voyage.run(6.0)
    assert voyage.counts["outlier:sensor/usbl"] == 3
    assert voyage.error() == pytest.approx(0.0, abs=1.5)
    voyage.run(6.0)
    assert voyage.counts["restarted:position"] == 1
    voyage.spike = 0.0
    assert voyage.error() == pytest.approx(30.0, abs=3.0)


# A leaning attitude could explain what lasts longer; once a second, it could explain every sample.
@pytest.mark.parametrize("every", [20, 7])  # 5 and 14 times a second
def test_fish_that_pass_below_are_not_the_bottom_however_often_they_are_seen(every: int) -> None:
    voyage = Voyage(usbl=False, every=every)
    voyage.run(30.0)
    place = voyage.error()
    voyage.fish = 0.5
    voyage.run(0.9)
    assert voyage.counts["outlier:sensor/dvl"] >= 4
    voyage.fish = 0.0
    voyage.run(5.0)
    assert voyage.counts["restarted:velocity"] == 0
    assert abs(voyage.error() - place) < 0.15  # believed, they would carry it off by 0.45 m
    found = voyage.observer.estimates(voyage.k * S // 100)
    assert found["surge_velocity"].value == pytest.approx(0.8, abs=0.05)


@pytest.mark.parametrize("fish", [-0.3, 0.6])
def test_fish_that_stay_for_two_seconds_move_nothing(fish: float) -> None:
    voyage = Voyage(usbl=False, every=10)
    voyage.run(30.0)
    place = voyage.error()
    voyage.fish = fish
    voyage.run(2.0)
    voyage.fish = 0.0
    voyage.run(5.0)
    assert voyage.counts["restarted:velocity"] == 0
    assert abs(voyage.error() - place) < 0.06


def test_a_bottom_that_moves_for_good_is_followed_in_the_end() -> None:
    voyage = Voyage(usbl=False, every=10)
    voyage.run(30.0)
    voyage.fish = 3.0
    voyage.run(3.5)
    assert voyage.counts["restarted:velocity"] == 0
    voyage.run(2.5)
    assert voyage.counts["restarted:velocity"] == 1


def test_after_the_drop_out_of_both_validity_falls_and_then_nothing_is_known() -> None:
    voyage = Voyage()
    voyage.run(30.0)
    voyage.dvl = voyage.usbl = False
    voyage.run(13.0)
    assert voyage.valid()  # a fix of 15 s ago
    voyage.run(4.0)
    assert not voyage.valid()
    voyage.run(60.0)
    assert voyage.observer.estimates(voyage.k * S // 100) == {}
    assert voyage.counts["lost:position"] == 1
    voyage.dvl = voyage.usbl = True
    voyage.run(20.0)
    assert voyage.valid()
    assert voyage.error() < 1.5


def test_an_origin_has_a_name_and_another_origin_another_one() -> None:
    voyage = Voyage(usbl=False)
    assert voyage.observer.origin is None
    assert voyage.observer.estimates(0) == {}
    voyage.run(5.0)
    first = voyage.observer.origin
    assert first
    voyage.usbl = True
    voyage.run(5.0)
    assert voyage.observer.origin == 0  # that of the fixes
    voyage.dvl = voyage.usbl = False
    voyage.run(62.0)
    assert voyage.observer.origin is None
    voyage.dvl = True
    voyage.run(3.0)
    assert voyage.observer.origin not in (None, 0, first)


@pytest.mark.slow
def test_a_simulated_vehicle_with_dvl_and_usbl_knows_where_it_is() -> None:
    legs = "0,0,0,0,0\n12,0.5,0,0.3,0.2\n35,0,0.3,0,-0.2\n70,0,0,0,0\n"
    tables = ["simulator.dvl.std=0.01", "simulator.usbl.std=0.3", "simulator.usbl.latency=1.0"]
    dive = Dive(legs, still_s=10.0, overrides=tables)
    states, truth = dive.heard(topics.STATE), dive.heard(topics.TRUTH)
    dive.run(60.0)
    by_stamp = {m.stamp_ns: m for m in truth}
    errors, speeds = list[float](), list[float]()
    for state in states:
        if state.sensor_ns < 25 * S:
            continue
        there = by_stamp[state.sensor_ns]
        assert state.north is not None
        assert state.east is not None
        assert state.surge_velocity is not None
        assert state.north.valid
        north, east, _ = there.position
        errors.append(hypot(state.north.value - north, state.east.value - east))
        speeds.append(state.surge_velocity.value - there.velocity[0])
    assert hypot(*truth[-1].position[:2]) > 2.0  # it has travelled
    assert max(errors) < 1.0
    assert np.sqrt(np.mean(np.square(speeds))) < 0.1
    assert states[-1].current_north is not None  # the simulated thrusters say what they do
    assert states[-1].current_north.value == pytest.approx(0.0, abs=0.1)


def test_only_what_is_measured_over_the_ground_moves_the_place() -> None:
    """A north that is known better turns the whole way there; who holds a place stays."""
    f = ErrorStateFilter()
    f.forget(DEPTH, 0.1)
    f.forget(POSITION, 1.0)
    f.P[DEPTH, POSITION] = f.P[POSITION, DEPTH] = 0.05
    quantity = Quantity("pressure", "m", 0.01)
    assert quantity.fuse(f, ((DEPTH, 1.0),), 0.1, 0.1, 0) is Fusion.USED
    assert f.position == [0.0, 0.0, pytest.approx(0.1, abs=0.01)]
