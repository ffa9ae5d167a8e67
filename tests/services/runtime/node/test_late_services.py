"""A late or stopped service counts it and says so, once; a punctual one says nothing."""

from collections import Counter
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import LATE_MS, Health
from messages.sensors import ImuSample
from services.runtime.node.loop_stats import CALM_NS, STALLED_NS, LoopStats
from services.runtime.node.node import Node
from tests.support.faults.hindrance import Hindrance
from tests.support.hindered_host import HinderedHost

S = 1_000_000_000  # [ns]
DRONE = ["drone"]


class Dive:
    """A trigger at 100 Hz, hindered, and somebody who reads."""

    def __init__(self) -> None:
        self.hindrance = Hindrance(lambda: self.host.now, 0)
        self.host = HinderedHost(lateness={"control": self.hindrance})
        self.health: list[Health] = []
        self.told: list[str] = []
        talker = self.host.node("talker", DRONE)
        says = talker.publisher(topics.IMU)
        force, rate = (0.0, 0.0, -9.8), (0.0, 0.0, 0.0)
        talker.every(
            100.0,
            lambda now: says.put(ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate)),
        )
        self.late: Node = self.host.node("control", DRONE)
        self.late.trigger(topics.IMU, lambda _m, _n: None, 1.0)
        ear = self.host.node("ear", DRONE)
        ear.each(topics.HEALTH, self._hear)
        ear.each(topics.LOG, lambda line, _: self.told.append(line.text))
        self.run(1.5)

    def _hear(self, health: Health, _: int) -> None:
        if health.service == "control":
            self.health.append(health)

    def run(self, seconds: float) -> None:
        self.host.run(self.host.now + round(seconds * S))


def test_a_punctual_service_says_and_counts_nothing() -> None:
    dive = Dive()
    dive.run(5.0)
    assert (dive.told, dive.late.counts) == ([], {})


def test_a_slow_service_is_as_late_as_the_messages_that_it_skips_and_says_so_once() -> None:
    dive = Dive()
    dive.hindrance.slow(0.1)
    dive.run(5.0)
    newest = dive.health[-1].lateness_p99_ms
    assert newest is not None
    assert LATE_MS < newest <= 100.0
    assert len(dive.told) == 1
    assert dive.told[0].startswith("late: handles messages 0.")
    assert dive.late.counts["stalled"] == 0


def test_a_service_that_was_stopped_counts_it_and_says_so() -> None:
    dive = Dive()
    dive.hindrance.stop()
    dive.run(0.3)
    dive.hindrance.go_on()
    dive.run(2.0)
    assert dive.late.counts["stalled"] == 1
    assert dive.told == [
        "late: handles messages 0.15 s late or more; the computer is too busy, or it was stopped"
    ]


def test_a_service_that_only_collects_may_wait_for_its_disk() -> None:
    dive = Dive()
    dive.late.collect("drone", "state", lambda _e, _n: None, 10)
    dive.hindrance.stop()
    dive.run(2.0)
    dive.hindrance.go_on()
    dive.run(2.0)
    assert dive.told == []


@given(st.lists(st.lists(st.integers(0, S), max_size=5), min_size=1, max_size=40))
def test_it_is_said_at_most_once_in_a_while_and_never_of_the_first_period(
    periods: list[list[int]],
) -> None:
    stats, said = LoopStats(), list[int]()
    for second, lateness in enumerate(periods):
        for late in lateness:
            stats.handled(late)
        stalled, words = stats.behind(second * S)
        assert stalled == (second > 0 and max(lateness, default=0) > STALLED_NS)
        if words:
            said.append(second)
        stats.report("x", second * S, 0, 0, Counter(), None)
    assert 0 not in said
    late = [k for k, period in enumerate(periods) if k and max(period, default=0) > STALLED_NS]
    assert not late or said
    assert all(b - a >= 2 for a, b in pairwise(said))
    assert CALM_NS == 10 * S
