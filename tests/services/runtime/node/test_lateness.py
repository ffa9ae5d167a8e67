"""What a late or stopped service counts and says, and what drives a late trigger."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import LATE_MS, Health
from messages.sensors import ImuSample
from services.runtime.bus.envelope import Envelope
from services.runtime.node.loop_stats import CALM_NS, STALLED_NS, LoopStats, Usage
from services.runtime.node.node import Node
from tests.support.hindered_host import HinderedHost, Hindrance, Jitter, Lateness
from tests.support.said import imu

S, HZ = 1_000_000_000, 100  # [ns], [1/s]
DRONE = ["drone"]


def talking(lateness: Lateness) -> HinderedHost:
    """A punctual talker, and whatever is called "listener" is late."""
    host = HinderedHost(lateness={"listener": lateness})
    says = host.node("talker", DRONE).publisher(topics.IMU)
    host.nodes["talker"].every(HZ, lambda now: says.put(imu(now)))
    return host


class Dive:
    """A trigger, hindered, and somebody who reads."""

    def __init__(self) -> None:
        self.hindrance = Hindrance(lambda: self.host.now)
        self.host = talking(self.hindrance)
        self.health: list[Health] = []
        self.told: list[str] = []
        self.late: Node = self.host.node("listener", DRONE)
        self.late.trigger(topics.IMU, lambda _m, _n: None, 1.0)
        ear = self.host.node("ear", DRONE)
        ear.each(topics.HEALTH.of("listener"), lambda health, _: self.health.append(health))
        ear.each(topics.LOG, lambda line, _: self.told.append(line.text))
        self.run(1.5)

    def run(self, seconds: float) -> None:
        self.host.run(self.host.now + round(seconds * S))


def test_a_slow_service_is_as_late_as_the_messages_that_it_skips_and_says_so_once() -> None:
    dive = Dive()
    dive.hindrance.slow(0.1)
    dive.run(5.0)
    newest = dive.health[-1].lateness_p99_ms
    assert newest is not None
    assert LATE_MS < newest <= 100.0
    assert len(dive.told) == 1
    assert dive.told[0].startswith("runs 0.")
    assert dive.late.counts["stalled"] == 0


def test_a_service_that_was_stopped_counts_it_and_says_so() -> None:
    dive = Dive()
    dive.hindrance.stop()
    dive.run(0.3)
    dive.hindrance.go_on()
    dive.run(2.0)
    assert dive.late.counts["stalled"] == 1
    assert dive.told == ["runs 0.15 s behind or more: the computer is too busy, or it was stopped"]


def test_a_punctual_service_says_nothing_and_one_that_only_collects_may_wait_for_its_disk() -> None:
    dive = Dive()
    dive.run(3.0)
    assert (dive.told, dive.late.counts) == ([], {})
    dive.late.collect("drone", "state", lambda _e, _n: None, 10)
    dive.hindrance.stop()
    dive.run(2.0)
    dive.hindrance.go_on()
    dive.run(2.0)
    assert dive.told == []


@given(st.lists(st.lists(st.integers(0, S), max_size=5), min_size=1, max_size=40))
def test_lateness_is_said_rarely_and_never_of_the_first_period(periods: list[list[int]]) -> None:
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


# A trigger of a late service: the newest drives, and the others are used or counted.


jitters = st.builds(
    Jitter,
    delay=st.sampled_from([0.0, 0.001, 0.02, 0.05]),
    stall=st.sampled_from([0.0, 0.1, 0.4]),
    stall_every=st.floats(0.2, 5.0),
)


@given(jitters, st.integers(0, 1000))
def test_a_trigger_hands_on_the_newest_and_counts_the_others(jitter: Jitter, seed: int) -> None:
    host = talking(Lateness(jitter, np.random.default_rng(seed)))
    listener = host.node("listener", DRONE)
    drove: list[int] = []
    everything: list[int] = []

    def on_newest(message: ImuSample | None, _: int) -> None:
        if message is not None:
            drove.append(message.seq)

    def on_any(message: ImuSample | None, _: int) -> None:
        if message is not None:
            everything.append(message.seq)

    listener.trigger(topics.IMU, on_newest, 10.0)
    listener.trigger(topics.IMU, on_any, 10.0, earlier=on_any)
    host.run(5 * S)
    assert everything == list(range(everything[-1] + 1))
    assert drove == sorted(set(drove))
    counted = listener.counts["skipped:sensor/imu"] + listener.counts["overflowed:sensor/imu"]
    assert drove[-1] == everything[-1]
    assert len(drove) + counted >= len(everything)


def test_a_port_that_uses_every_message_has_room_for_half_a_second() -> None:
    host = talking(Hindrance(lambda: 0))
    listener = host.node("listener", DRONE)
    listener.trigger(topics.IMU, lambda _, __: None, 10.0, earlier=lambda _, __: None)
    listener.wake = lambda: None  # stopped
    host.run(S // 2)
    listener.step()
    assert not listener.counts


def test_garbage_behind_the_newest_message_does_not_take_its_place() -> None:
    host, heard = HinderedHost(), list[int]()
    listener, foreign = host.node("listener", DRONE), host.side("drone")

    def hear(message: ImuSample | None, _: int) -> None:
        if message is not None:
            heard.append(message.stamp_ns)

    listener.trigger(topics.IMU, hear, 10.0)
    says = host.node("talker", DRONE).publisher(topics.IMU)
    says.put(imu(1))
    says.put(imu(2))
    foreign.forward(Envelope("sensor/imu", b"\xff", "text/plain"))
    listener.step()
    assert heard == [2]
    assert listener.counts == {"skipped:sensor/imu": 1, "wrong_type:sensor/imu": 1}


# A service's own report: rates and lateness of the period since the last one, nothing kept.


LATE = st.integers(-1_000, 10 * S)  # [ns]; slightly early is possible by rounding


def report(stats: LoopStats, now: int = S, usage: Usage | None = None) -> Health:
    return stats.report("control", now, 3, 4, Counter(stale=2), usage)


def of(lateness: list[int]) -> Health:
    stats = LoopStats()
    for late in lateness:
        stats.handled(late)
    return report(stats)


@given(st.lists(LATE, min_size=1, max_size=300))
def test_percentiles_are_values_that_occurred_never_negative(lateness: list[int]) -> None:
    health = of(lateness)
    happened = {max(0, late) / 1e6 for late in lateness}
    assert health.lateness_p50_ms in happened
    assert health.lateness_p99_ms in happened
    assert health.lateness_p50_ms is not None
    assert health.lateness_p99_ms is not None
    assert 0.0 <= health.lateness_p50_ms <= health.lateness_p99_ms <= max(happened)
    below = sum(max(0, late) / 1e6 < health.lateness_p50_ms for late in lateness)
    above = sum(max(0, late) / 1e6 > health.lateness_p50_ms for late in lateness)
    assert max(below, above) <= len(lateness) / 2 + 1


@given(st.lists(LATE, max_size=30), st.lists(LATE, max_size=30), st.integers(1, 100))
def test_each_report_is_of_its_own_period(
    first: list[int], second: list[int], seconds: int
) -> None:
    stats = LoopStats()
    for late in first:
        stats.handled(late)
    report(stats)
    for late in second:
        stats.handled(late)
    health = report(stats, (1 + seconds) * S)
    assert health.loop_hz == pytest.approx(len(second) / seconds)
    again = of(second)
    assert (health.lateness_p50_ms, health.lateness_p99_ms) == (
        again.lateness_p50_ms,
        again.lateness_p99_ms,
    )


def test_processor_time_is_a_share_of_the_period_and_counts_are_a_copy() -> None:
    stats, counts = LoopStats(), Counter(stale=1)
    first = report(stats, S, Usage(cpu_s=5.0, rss_mb=40.0))
    assert (first.cpu_percent, first.rss_mb) == (None, 40.0)  # it would count the imports
    health = stats.report("control", 3 * S, 3, 4, counts, Usage(cpu_s=5.5, rss_mb=41.0))
    assert (health.cpu_percent, health.rss_mb) == (25.0, 41.0)
    counts["stale"] += 1
    assert health.counts == {"stale": 1}
