"""A trigger of a late service: the newest drives, and the others are used or counted."""

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
