"""The deviation of the compass, as DVL and fixes show it: found under way, harmless otherwise."""

from collections import Counter
from collections.abc import Callable
from math import cos, degrees, pi, radians, sin

import numpy as np
import pytest

from messages import events
from messages.events import Event
from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from services.estimation.attitude.heading import wrapped
from services.estimation.horizontal.compass_deviation import (
    MOST,
    NONE,
    Coefficients,
    CompassDeviation,
)
from services.estimation.horizontal.horizontal_observer import HorizontalObserver, VehicleMotion
from services.marine.attitude import from_euler
from services.marine.vehicle import GRAVITY

S = 1_000_000_000  # [ns]
STD = 0.07  # [rad] of the compass
CARD = Coefficients(0.0, radians(-3.0), radians(4.0))
RIGHT = NONE


class Voyage:
    """A level vehicle on a circle of 8 m, whose compass is off by a deviation card."""

    def __init__(self, card: Coefficients, seed: int = 0, speed: float = 0.4, late: float = 0.0):
        self.card, self.speed, self.late = card, speed, late
        self.observer = HorizontalObserver()
        self.rng = np.random.default_rng(seed)
        self.counts: Counter[str] = Counter()
        self.waiting: list[tuple[int, UsblSample]] = []
        self.dvl = self.usbl = True
        self.jump = 0.0  # [m] on the fixes
        self.k, self.course = 0, 0.0

    def compass(self) -> float:
        """[rad] What it shows: true heading = shown + card at what is shown."""
        shown = self.course
        for _ in range(5):
            shown = self.course - self.card.at(shown)
        return shown

    def run(self, seconds: float, watch: Callable[[], None] = lambda: None) -> None:
        for _ in range(round(100 * seconds)):
            self.k += 1
            now, turn = self.k * S // 100, self.speed / 8.0
            self.course += turn / 100
            force = (0.0, self.speed * turn, -GRAVITY)
            motion = VehicleMotion(
                from_euler(0.0, 0.0, self.compass()), 0.0, STD, force, yaw_rate=turn
            )
            self.note(self.observer.predict(motion, now))
            a, b, c, d = self.rng.standard_normal(4).tolist()
            if self.dvl and self.k % 100 == 0:
                seen = (self.speed + 0.005 * a, 0.005 * b, 0.0)
                self.note(self.observer.dvl(DvlSample(stamp_ns=now, velocity=seen, std=0.005)))
            if self.usbl and self.k % 100 == 50:
                north = 8.0 * sin(self.course) + self.jump + 0.1 * c
                east = 8.0 * (1.0 - cos(self.course)) + 0.1 * d
                fix = UsblSample(stamp_ns=now, north=north, east=east, std=0.1)
                self.waiting.append((now + round(self.late * S), fix))
            while self.waiting and self.waiting[0][0] <= now:
                self.note(self.observer.usbl(self.waiting.pop(0)[1]))
            watch()

    def note(self, what: Event | None) -> None:
        self.counts.update(() if what is None else (what.name,))

    def corrected(self) -> Estimate:
        return self.observer.heading(Estimate(wrapped(self.compass()), STD, valid=True))

    def error(self) -> float:
        """[°] Of the corrected heading."""
        return degrees(abs(wrapped(self.corrected().value - self.course)))


@pytest.mark.parametrize("late", [0.0, 1.5])
@pytest.mark.parametrize("seed", range(2))
def test_after_a_circle_most_of_the_deviation_is_corrected_and_the_spread_says_so(
    late: float, seed: int
) -> None:
    voyage = Voyage(CARD, seed, late=late)
    voyage.run(130.0)
    errors: list[float] = []
    voyage.run(60.0, lambda: errors.append(voyage.error()))
    assert np.sqrt(np.mean(np.square(errors))) < 1.0  # the compass alone: 3.5°
    assert max(errors) < 2.5
    assert degrees(voyage.corrected().std) < 1.5


@pytest.mark.parametrize("late", [0.0, 1.5])
@pytest.mark.parametrize("seed", range(2))
def test_a_compass_that_is_right_stays_nearly_right(late: float, seed: int) -> None:
    voyage = Voyage(RIGHT, seed, late=late)
    errors: list[float] = []
    voyage.run(120.0, lambda: errors.append(voyage.error()))
    assert max(errors) < 1.5
    assert np.sqrt(np.mean(np.square(errors))) < 0.8


def test_at_rest_nothing_is_learnt() -> None:
    voyage = Voyage(CARD, speed=0.0)
    voyage.run(60.0)
    assert voyage.observer.heading(compass := Estimate(1.0, STD, valid=True)) == compass


@pytest.mark.parametrize("without", ["dvl", "usbl"])
def test_one_aid_alone_tells_nothing_of_north(without: str) -> None:
    voyage = Voyage(CARD)
    setattr(voyage, without, False)
    voyage.run(50.0)
    assert voyage.observer.heading(compass := Estimate(1.0, STD, valid=True)) == compass


def test_fixes_that_jump_hardly_turn_the_heading() -> None:
    voyage = Voyage(CARD)
    voyage.run(130.0)
    errors: list[float] = []
    voyage.jump = 5.0
    voyage.run(60.0, lambda: errors.append(voyage.error()))
    assert voyage.counts["restarted:position"] == 1
    assert max(errors) < 2.5


def test_without_a_dvl_what_was_learnt_is_held_with_the_spread_of_the_compass() -> None:
    voyage = Voyage(CARD)
    voyage.run(130.0)
    voyage.dvl = False
    voyage.run(4.0)
    before = voyage.observer.heading(Estimate(1.0, STD, valid=True))
    voyage.run(20.0)
    assert voyage.observer.heading(Estimate(1.0, STD, valid=True)) == before
    assert before.std == STD


def test_when_the_place_is_lost_the_correction_fades_without_a_jump() -> None:
    voyage = Voyage(CARD)
    voyage.run(130.0)
    voyage.dvl = voyage.usbl = False
    voyage.run(59.0)
    seen = [voyage.observer.heading(Estimate(1.0, STD, valid=True)).value]
    voyage.run(500.0, lambda: seen.append(voyage.observer.heading(Estimate(1.0, STD, True)).value))
    assert np.max(np.abs(np.diff(seen))) < radians(0.01)
    assert seen[0] != 1.0
    assert seen[-1] == 1.0


def test_a_deviation_that_no_compass_should_have_is_limited_and_counted_once() -> None:
    deviation, wild = CompassDeviation(), Coefficients(0.1, -0.3, 0.4)
    counts = Counter(deviation.follow(wild, 0.01, 0.5, 0.1) for _ in range(2000))
    assert counts == {events.LIMITED("deviation"): 1, None: 1999}
    assert deviation.correction.largest == pytest.approx(MOST, rel=1e-4)
    most = max(abs(deviation.correction.at(x)) for x in np.linspace(-pi, pi, 200).tolist())
    assert most <= MOST
