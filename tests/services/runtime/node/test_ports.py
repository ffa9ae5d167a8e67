"""Ports and timers: nothing waits unheard, acts when stale, is lost uncounted or drifts."""

import sys
import threading
from collections import Counter, deque

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.pilot import PilotCommand
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.gate import Gate
from services.runtime.node.node import EVENTS, RING, Node
from services.runtime.node.ports import Alarm, Inbox, Latest, Publisher, Tick
from tests.support.messages import enveloped
from tests.support.patience import PATIENCE_S
from tests.support.said import sticks

MS, SECOND = 1_000_000, 1_000_000_000
COMMAND = topics.PILOT_COMMAND


class Ear:
    """A latest-wins port with its counts."""

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self._inbox = Inbox(COMMAND.key, RING, lambda: 0, Outbox(self.counts))
        gate = Gate(COMMAND, Outbox(self.counts))
        self.port = Latest(COMMAND, self._inbox, gate, Outbox(self.counts))

    def store(self, message: PilotCommand) -> None:
        self._inbox.store(enveloped(COMMAND, message))


@given(st.integers(1, 4), st.integers(0, 40))
def test_messages_are_numbered_from_nought_alike_in_every_realm(realms: int, number: int) -> None:
    said: list[list[int]] = [[] for _ in range(realms)]
    decode = msgspec.msgpack.Decoder(PilotCommand).decode
    publisher = Publisher(
        COMMAND, [lambda payload, into=into: into.append(decode(payload).seq) for into in said]
    )
    for now in range(number):
        publisher.put(sticks(now))
    assert publisher.sent == number
    assert said == [list(range(number))] * realms


@given(st.integers(1, 1000), st.integers(0, 2000))
def test_a_command_is_fresh_for_its_time_to_live_and_no_longer(ttl_ms: int, age_ms: int) -> None:
    ear = Ear()
    ear.store(sticks(SECOND, ttl_ms=ttl_ms))
    assert ear.port.newest(SECOND) is not None
    fresh = ear.port.fresh(SECOND + age_ms * MS)
    assert (fresh is not None) == (age_ms <= ttl_ms)
    assert ear.port.newest(SECOND + age_ms * MS) is not None


@given(st.lists(st.integers(0, 400), min_size=1, max_size=30))
def test_each_passage_from_fresh_to_stale_is_counted_once(pauses: list[int]) -> None:
    """A command, a pause [ms] in which the port is looked at each 10 ms, the next command …"""
    ear, now = Ear(), SECOND
    for pause in pauses:
        ear.store(sticks(now))
        for later in range(now, now + pause * MS + 1, 10 * MS):
            ear.port.fresh(later)
        now += (pause + 1) * MS
    went_stale = sum(pause // 10 * 10 > 300 for pause in pauses)
    assert ear.counts[f"stale:{COMMAND.key}"] == went_stale


@given(st.lists(st.integers(0, 50), min_size=1, max_size=RING))
def test_of_commands_that_come_in_any_order_the_newest_is_kept(ages: list[int]) -> None:
    ear = Ear()
    for age in ages:
        ear.store(sticks(SECOND - age * MS))
    newest = ear.port.newest(SECOND)
    assert newest is not None
    assert newest.stamp_ns == SECOND - min(ages) * MS


@given(st.integers(0, 3 * EVENTS), st.booleans())
def test_what_does_not_fit_between_two_steps_is_counted(number: int, every: bool) -> None:
    bus, heard = MemoryBus(), list[int]()
    node = Node("ear", {"drone": MemoryBusPort(bus)}, lambda: SECOND, VolatileCheckpoint())
    depth = EVENTS if every else RING
    port = None if every else node.latest(COMMAND)
    if every:
        node.each(COMMAND, lambda message, _: heard.append(message.stamp_ns))
    talker = MemoryBusPort(bus)
    for k in range(number):
        talker.forward(enveloped(COMMAND, sticks(SECOND - number + k)))
    node.step()
    kept = list(range(SECOND - number, SECOND))[-depth:]
    if port is not None:
        newest = port.newest(SECOND)
        assert (newest and newest.stamp_ns) == (kept[-1] if kept else None)
    else:
        assert heard == kept
    assert node.counts[f"overflowed:{COMMAND.key}"] == max(0, number - depth)


def test_before_its_first_trigger_nothing_overflows_that_a_service_reads_at_100_hz() -> None:
    """As control, which reads the state when a reference comes, and there is none yet."""
    host = VirtualHost()
    control, estimation = host.node("control", ["drone"]), host.node("estimation", ["drone"])
    state, read = control.latest(topics.STATE), list[bool]()
    control.trigger(topics.REFERENCE, lambda _, now: read.append(bool(state.fresh(now))), 0.1)
    said = estimation.sides["drone"].say(topics.STATE)
    estimation.every(topics.STATE.hz, lambda _: said(b""))
    host.run(10**9)
    assert read
    assert "overflowed:state" not in control.counts


# The ring between two threads: nothing waits unheard, and nothing is lost uncounted.


def entry(number: int) -> Envelope:
    return Envelope(f"{number}", b"", "")


def test_what_comes_while_a_full_ring_is_emptied_is_told_of_and_nothing_overflowed() -> None:
    """The service takes everything between two steps of `store`: when that asks for the time."""
    counts, taken, told = Counter[str](), list[str](), list[int]()
    meanwhile = False

    def clock() -> int:
        if meanwhile:
            taken.extend(e.key for _, e in inbox.take_all())
        return 0

    inbox = Inbox("x", 2, clock, Outbox(counts))
    inbox.arrived = lambda: told.append(len(taken))
    inbox.store(entry(1))
    inbox.store(entry(2))
    meanwhile = True
    inbox.store(entry(3))
    meanwhile = False
    assert taken == ["1", "2"]
    assert told[-1] == 2  # after the first two were taken, the service was told once more
    taken.extend(e.key for _, e in inbox.take_all())
    assert taken == ["1", "2", "3"]
    assert counts == {}


def test_what_is_taken_while_a_full_ring_overflows_is_not_the_newest_lost() -> None:
    """The service takes all between the look at the ring's length and the pop of its oldest."""
    taken, services = list[str](), list[threading.Thread]()

    def take() -> None:
        taken.extend(e.key for _, e in inbox.take_all())

    class Watched(deque[tuple[int, Envelope]]):
        def __len__(self) -> int:
            length = super().__len__()
            if length > 1 and not services:
                services.append(threading.Thread(target=take))
                services[0].start()
                services[0].join(0.1)  # [s] it waits for `store`, or has taken by then
            return length

    counts = Counter[str]()
    inbox = Inbox("x", 1, lambda: 0, Outbox(counts))
    inbox._ring = Watched()  # pyright: ignore[reportPrivateUsage]
    inbox.store(entry(1))
    inbox.store(entry(2))
    services[0].join()
    take()
    assert taken[-1] == "2"
    assert len(taken) + counts["overflowed:x"] == 2


def test_the_service_is_told_once_until_it_looks() -> None:
    counts, told = Counter[str](), list[str]()
    inbox = Inbox("x", 4, lambda: 0, Outbox(counts))
    inbox.arrived = lambda: told.append("")
    for round_ in range(1, 4):
        for number in range(10):
            inbox.store(entry(number))
        assert len(told) == round_
        assert [e.key for _, e in inbox.take_all()] == ["6", "7", "8", "9"]
    assert counts == {"overflowed:x": 18}


@pytest.mark.parametrize("depth", [1, 8])
def test_two_threads_lose_nothing_that_is_not_counted(depth: int) -> None:
    """The service sleeps until it is told, as a process does: one lost word and it hangs."""
    number, counts, taken = 10_000, Counter[str](), list[int]()
    told, wake = deque[str](), threading.Event()

    def arrived() -> None:
        told.append("")
        wake.set()

    def serve() -> None:
        while not taken or taken[-1] < number - 1:
            if not wake.wait(PATIENCE_S):
                return
            wake.clear()
            while told:
                told.popleft()
                taken.extend(int(e.key) for _, e in inbox.take_all())

    inbox = Inbox("x", depth, lambda: 0, Outbox(counts))
    inbox.arrived = arrived
    service = threading.Thread(target=serve)
    switching = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        service.start()
        for k in range(number):
            inbox.store(entry(k))
        service.join(2 * PATIENCE_S)
    finally:
        sys.setswitchinterval(switching)
    assert not service.is_alive()
    assert taken[-1] == number - 1
    assert taken == sorted(set(taken))
    assert len(taken) + counts["overflowed:x"] == number == inbox.stored


# A tick drifts nowhere and loses nothing uncounted, an alarm rings once.


HZ = st.sampled_from([0.5, 1.0, 3.0, 42.0, 50.0, 100.0, 999.0])
STARTS = st.integers(0, 10**15)  # [ns]
LATE = st.floats(0.0, 40.0)  # [periods] after its time that a tick is looked at


def period(hz: float) -> int:
    return round(1e9 / hz)


@given(HZ, STARTS, st.lists(LATE, min_size=1, max_size=50))
def test_a_tick_stays_on_its_grid_and_loses_no_period(
    hz: float, start: int, lateness: list[float]
) -> None:
    rung, skipped = list[int](), 0
    tick = Tick(hz, start, rung.append)
    now = start
    for late in lateness:
        assert tick.due is not None
        now = max(now, tick.due + round(late * period(hz)))
        skipped += tick.ring(now)
        assert tick.due is not None
        assert (tick.due - start) % period(hz) == 0
    assert rung == sorted(rung)
    passed = (tick.due or 0) - start
    assert passed // period(hz) == 1 + len(rung) + skipped


@given(HZ, STARTS, st.integers(0, 10**10))
def test_a_slow_start_is_no_missed_tick(hz: float, made: int, took: int) -> None:
    tick = Tick(hz, made, lambda _: None)
    tick.start(made + took)
    due = made + took + period(hz)
    assert tick.due == due
    assert not tick.ring(due)


@given(HZ, STARTS, st.integers(1, 20) | st.integers(1, 10**6))
@example(1.0, 0, 10)
@example(1.0, 0, 11)
def test_a_short_delay_is_caught_up_with_and_after_a_long_one_one_tick_rings(
    hz: float, start: int, behind: int
) -> None:
    rung, missed = list[int](), 0
    tick = Tick(hz, start, rung.append)
    now = start + (1 + behind) * period(hz)
    while tick.due is not None and tick.due <= now:
        missed += tick.ring(now)
    is_short = behind <= 10
    assert missed == (0 if is_short else behind)
    assert rung == [now] * (1 + behind if is_short else 1)
    assert tick.due == now + period(hz)


def test_an_alarm_rings_once_when_it_was_set_to_last_also_by_its_own_handler() -> None:
    rung = list[int]()

    def ring(now: int) -> None:
        rung.append(now)
        alarm.set(now + 5 if now < 5 else None)

    alarm = Alarm(ring)
    for at in (7, None, 1):
        alarm.set(at)
        assert alarm.due == at
    assert (alarm.ring(2), rung, alarm.due) == (0, [2], 7)
    assert (alarm.ring(7), rung, alarm.due) == (0, [2, 7], None)
