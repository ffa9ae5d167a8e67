"""A node stepped by two threads: nothing is lost, nothing is handled twice or at once."""

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

import pytest

from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.hosts import loop as module
from services.runtime.hosts.loop import Loop
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.loop_stats import Usage
from services.runtime.node.node import Node
from tests.support.patience import PATIENCE_S, until

HOUR_NS = 3600 * 10**9


class Bench:
    """A node on a bus in memory; whoever says something is the bus's thread."""

    def __init__(self, handler: Callable[[Envelope, int], None]) -> None:
        bus = MemoryBus()
        # Ahead of the time by which the loop waits, so that no timer of the node's own is due.
        self.node = Node(
            "toy",
            {"drone": MemoryBusPort(bus)},
            lambda: time.monotonic_ns() + HOUR_NS,
            VolatileCheckpoint(),
        )
        self.node.tap("drone", "x/*", handler, depth=100_000)
        self._ends = [MemoryBusPort(bus) for _ in range(2)]

    def loop(self, *, on_arrival: bool) -> Loop:
        return Loop([self.node], lambda: Usage(0.0, 0.0), on_arrival=on_arrival)

    def say(self, number: int, end: int = 0) -> None:
        self._ends[end].forward(Envelope(f"x/{end}", str(number).encode(), ""))


@contextmanager
def stepping(loop: Loop, failures: list[BaseException] | None = None) -> Generator[None]:
    """The service's thread, as a process has it."""
    stop = threading.Event()

    def run() -> None:
        try:
            while not stop.is_set():
                loop.step_and_wait()
            loop.finish()
        except ZeroDivisionError as failure:
            assert failures is not None
            failures.append(failure)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(PATIENCE_S)
    assert not thread.is_alive()


@pytest.mark.parametrize("on_arrival", [True, False])
def test_who_handles_a_message(on_arrival: bool) -> None:
    handled = list[int]()
    bench = Bench(lambda _, __: handled.append(threading.get_ident()))
    loop = bench.loop(on_arrival=on_arrival)
    with stepping(loop):

        def said_and_handled_here() -> bool:
            bench.say(0)
            return threading.get_ident() in handled

        if on_arrival:
            until(said_and_handled_here)
        else:
            bench.say(0)
            until(lambda: handled)
    assert (threading.get_ident() in handled) == on_arrival


def test_nothing_is_handled_before_the_first_step_or_after_the_last() -> None:
    handled = list[bytes]()
    bench = Bench(lambda envelope, _: handled.append(envelope.payload))
    loop = bench.loop(on_arrival=True)
    bench.say(1)
    assert handled == []
    with stepping(loop):
        until(lambda: handled)
    bench.say(2)
    assert handled == [b"1"]


@pytest.mark.parametrize("on_arrival", [True, False])
def test_of_many_messages_on_two_threads_each_is_handled_once_in_order_and_alone(
    on_arrival: bool,
) -> None:
    """While timers of the service's own thread ring all the time."""
    count, handled, inside, overlaps = 5000, list[tuple[str, int]](), list[int](), list[int]()

    def handler(envelope: Envelope, _: int) -> None:
        inside.append(1)
        if len(inside) > 1:
            overlaps.append(1)
        handled.append((envelope.key, int(envelope.payload)))
        inside.pop()

    def tick(_: int) -> None:
        handler(Envelope("tick", b"0", ""), 0)

    bench = Bench(handler)
    bench.node.every(2000.0, tick)

    def talk(end: int) -> None:
        for number in range(count):
            bench.say(number, end)
            if number % 50 == 0:
                time.sleep(0.001)  # so that the threads take turns

    with stepping(bench.loop(on_arrival=on_arrival)):
        talkers = [threading.Thread(target=talk, args=(end,)) for end in (0, 1)]
        for talker in talkers:
            talker.start()
        for talker in talkers:
            talker.join(PATIENCE_S)
        # Nothing more is said: whatever was left lying would stay there.
        until(lambda: sum(key != "tick" for key, _ in handled) == 2 * count)
    for end in (0, 1):
        assert [n for key, n in handled if key == f"x/{end}"] == list(range(count))
    assert overlaps == []
    assert "overflowed:x/*" not in bench.node.counts


def test_a_timer_set_by_a_handler_wakes_the_services_own_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "POLL_S", 10 * PATIENCE_S)  # it would sleep until then
    rung = threading.Event()
    bench = Bench(lambda _, __: alarm.set(0))
    alarm = bench.node.alarm(lambda _: rung.set())
    loop = bench.loop(on_arrival=True)
    stop = threading.Event()

    def run() -> None:
        while not stop.is_set():
            loop.step_and_wait()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    bench.say(1)
    assert rung.wait(PATIENCE_S)
    stop.set()
    bench.say(2)  # sets the timer again, which ends the wait
    thread.join(PATIENCE_S)
    assert not thread.is_alive()


def test_a_flood_does_not_keep_a_timer_from_ringing() -> None:
    rung = threading.Event()
    bench = Bench(lambda _, __: None)
    bench.node.every(50.0, lambda _: rung.set())
    deadline = time.monotonic() + PATIENCE_S
    with stepping(bench.loop(on_arrival=True)):
        while not rung.is_set() and time.monotonic() < deadline:  # a flood never pauses
            bench.say(0)
    assert rung.is_set()


def test_what_a_handler_raises_ends_the_service_with_its_traceback() -> None:
    handled = list[int]()

    def handler(envelope: Envelope, _: int) -> None:
        handled.append(1)
        _ = 1 // int(envelope.payload)

    bench, failures = Bench(handler), list[BaseException]()
    with stepping(bench.loop(on_arrival=True), failures):
        bench.say(1)
        until(lambda: handled)
        bench.say(0)
        until(lambda: failures)
        bench.say(1)
    names = list[str]()
    trace = failures[0].__traceback__
    while trace is not None:
        names.append(trace.tb_frame.f_code.co_name)
        trace = trace.tb_next
    assert names[-1] == "handler"
    assert handled == [1, 1]
