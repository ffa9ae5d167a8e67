"""The virtual host with late nodes: late, but nothing lost, doubled, or out of order."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.sensors import ImuSample
from services.runtime.bus.envelope import Envelope
from tests.support.hindered_host import HinderedHost
from tests.support.jitter import Jitter, Lateness

MS = 1_000_000  # [ns]
DRONE = ["drone"]
SECONDS, HZ = 5, 100
jitters = st.builds(
    Jitter,
    delay=st.sampled_from([0.0, 0.001, 0.02, 0.05]),
    stall=st.sampled_from([0.0, 0.1, 0.4]),
    stall_every=st.floats(0.2, 5.0),
)


def imu(now: int) -> ImuSample:
    return ImuSample(stamp_ns=now, specific_force=(0.0, 0.0, -9.81), angular_rate=(0.0, 0.0, 0.0))


def talking(jitter: Jitter, seed: int = 0) -> HinderedHost:
    """A punctual talker, and whatever is called "listener" is late."""
    host = HinderedHost(lateness={"listener": Lateness(jitter, np.random.default_rng(seed))})
    talker = host.node("talker", DRONE)
    says = talker.publisher(topics.IMU)
    talker.every(HZ, lambda now: says.put(imu(now)))
    return host


@settings(max_examples=40, deadline=None)
@given(jitters, st.integers(0, 1000))
def test_everything_is_handled_once_in_order_and_late_by_a_bounded_time(
    jitter: Jitter, seed: int
) -> None:
    host = talking(jitter, seed)
    heard: list[tuple[int, int]] = []
    host.node("listener", DRONE).each(topics.IMU, lambda m, now: heard.append((m.stamp_ns, now)))
    host.run(SECONDS * 1000 * MS)
    stamps = [stamp for stamp, _ in heard]
    assert stamps == [k * 10 * MS for k in range(1, len(stamps) + 1)]
    longest = round(1e9 * (jitter.delay + jitter.stall))
    assert len(stamps) >= SECONDS * HZ - longest // (10 * MS) - 1
    assert all(0 <= now - stamp <= longest for stamp, now in heard)
    assert all(a <= b for (_, a), (_, b) in pairwise(heard))


def test_a_stalled_node_handles_nothing_and_then_everything_at_once() -> None:
    host = talking(Jitter(stall=0.1, stall_every=0.5))
    heard: list[tuple[int, int]] = []
    host.node("listener", DRONE).each(topics.IMU, lambda m, now: heard.append((m.stamp_ns, now)))
    host.run(SECONDS * 1000 * MS)
    late = [(stamp, now) for stamp, now in heard if now > stamp]
    ends = sorted({now for _, now in late})
    assert len(ends) > 3
    for end in ends:
        assert not [now for _, now in heard if end - 100 * MS < now < end]
        waited = [stamp for stamp, now in late if now == end]
        assert waited == [10 * MS * k for k in range(waited[0] // (10 * MS), -(-end // (10 * MS)))]


def test_timers_are_late_too_but_do_not_drift() -> None:
    host = HinderedHost(
        lateness={"worker": Lateness(Jitter(delay=0.005), np.random.default_rng(0))}
    )
    rang: list[int] = []
    host.node("worker", DRONE).every(HZ, rang.append)
    host.run(SECONDS * 1000 * MS)
    late = [now - 10 * MS * k for k, now in enumerate(rang, 1)]
    assert min(late) >= 0
    assert max(late) <= 5 * MS
    assert len(set(late)) > 100


def test_how_the_time_is_cut_into_runs_changes_nothing() -> None:
    def handled(stride: int) -> list[int]:
        host, times = talking(Jitter(0.02, 0.1, 1.0)), list[int]()
        host.node("listener", DRONE).each(topics.IMU, lambda _, now: times.append(now))
        while host.now < 2000 * MS:
            host.run(host.now + stride)
        return times

    assert handled(3 * MS) == handled(2000 * MS)


@settings(max_examples=20, deadline=None)
@given(jitters, st.integers(0, 1000))
def test_a_trigger_hands_the_newest_on_and_accounts_for_the_others(
    jitter: Jitter, seed: int
) -> None:
    host = talking(jitter, seed)
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
    host.run(SECONDS * 1000 * MS)
    assert everything == list(range(everything[-1] + 1))
    assert drove == sorted(set(drove))
    counted = listener.counts["skipped:sensor/imu"] + listener.counts["overflowed:sensor/imu"]
    assert drove[-1] == everything[-1]
    assert len(drove) + counted >= len(everything)


@pytest.mark.parametrize("seconds", [0.05, 0.5])
def test_a_port_that_uses_every_message_has_room_for_half_a_second(seconds: float) -> None:
    host = talking(Jitter())
    listener = host.node("listener", DRONE)
    listener.trigger(topics.IMU, lambda _, __: None, 10.0, earlier=lambda _, __: None)
    listener.wake = lambda: None  # stopped
    host.run(round(seconds * 1e9))
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
