"""Nodes on one thread and on two: nothing is lost, handled twice, at once, or starved."""

import threading
import time
import traceback
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import Health, LogLine
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.bus.shared_bus import SharedBus, SharedBusPort
from services.runtime.hosts import loop as module
from services.runtime.hosts.loop import Loop
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.loop_stats import Usage
from services.runtime.node.node import Node
from tests.support.patience import PATIENCE_S, until

MS = 1_000_000
NODES = st.integers(1, 6)


@dataclass
class Toy:
    """Stands for a node; what a step of it does is drawn."""

    name: str
    stepped: Callable[[], None] = lambda: None
    due: int = 0  # [ns]
    wake: Callable[[], None] = lambda: None

    def start(self) -> None:
        pass

    def step(self) -> None:
        self.stepped()

    def deadline(self) -> int:
        return self.due


def loop_of(nodes: Sequence[Toy], now: Callable[[], int]) -> Loop:
    usage = Usage(0.0, 0.0)
    toys = cast(list[Node], list(nodes))
    return Loop(toys, lambda: usage, on_arrival=False, clock=now)


@given(st.data(), NODES)
def test_who_is_ready_waits_for_each_other_node_once(data: st.DataObject, count: int) -> None:
    """Whoever wakes whom, and whatever timers are due."""
    now, woken, toys = 0, set[int](), [Toy(str(k)) for k in range(count)]
    waiting = dict.fromkeys(range(count), 0)  # steps of others since a node became ready

    def ready() -> set[int]:
        return {k for k in range(count) if k in woken or toys[k].due <= now}

    def stepped(node: int) -> None:
        nonlocal now
        assert node in ready()
        woken.discard(node)
        for other in range(count):
            waiting[other] = waiting[other] + 1 if other in ready() and other != node else 0
            assert waiting[other] < count
        toys[node].due = now + data.draw(st.integers(0, 20))
        for other in data.draw(st.sets(st.integers(0, count - 1))):
            woken.add(other)
            toys[other].wake()
        now += data.draw(st.integers(0, 5))

    for k, toy in enumerate(toys):
        toy.stepped = partial(stepped, k)
    loop = loop_of(toys, lambda: now)
    for _ in range(data.draw(st.integers(1, 10))):
        anybody = bool(ready())
        assert (loop.step() > 0) == anybody


@given(NODES, st.sets(st.integers(0, 5)), st.integers(0, 5))
def test_all_who_are_ready_are_stepped_in_order(count: int, woken: set[int], again: int) -> None:
    order, toys = list[int](), [Toy(str(k), due=100) for k in range(count)]
    for k, toy in enumerate(toys):
        toy.stepped = partial(order.append, k)
    loop = loop_of(toys, lambda: 0)
    assert loop.step() == count  # everybody once, to begin with
    expected = sorted(k for k in woken if k < count)
    for k in expected:
        toys[k].wake()
    assert loop.step() == len(expected)
    assert order == [*range(count), *expected]
    node, wakes = toys[again % count], [1]
    node.stepped = lambda: node.wake() if wakes.pop() else None
    wakes.insert(0, 0)
    node.wake()
    while loop.step():
        pass
    assert wakes == []  # what arrives during a step causes another


@dataclass
class Machine:
    """Time that passes while nodes are stepped, and a process with nodes on it."""

    now: int = 0  # [ns]
    cpu_s: float = 7.0  # [s] of the process
    network: MemoryBus = field(default_factory=MemoryBus)

    def __post_init__(self) -> None:
        self.bus = SharedBus(MemoryBusPort(self.network))

    def node(self, name: str) -> Node:
        return Node(
            name, {"drone": SharedBusPort(self.bus)}, lambda: self.now, VolatileCheckpoint()
        )

    def host(self, *nodes: Node) -> Loop:
        return Loop(
            list(nodes),
            lambda: Usage(self.cpu_s, rss_mb=50.0),
            on_arrival=False,
            clock=lambda: self.now,
        )

    def run(self, host: Loop, until: int) -> None:
        while self.now < until:
            if not host.step():
                self.now += MS


def line(now: int) -> LogLine:
    return LogLine(stamp_ns=now, service="x", level="info", text="")


def on_line(node: Node, key: str, then: Callable[[int], None]) -> None:
    node.each(topics.LOG.of(key), lambda _, now: then(now))


def answering(node: Node, hears: str, says: str, then: Callable[[], None]) -> None:
    """A node that answers each line under one key with a line under another."""
    publisher = node.publisher(topics.LOG.of(says))

    def answer(now: int) -> None:
        then()
        publisher.put(line(now))

    on_line(node, hears, answer)


def test_a_chain_of_nodes_is_gone_through_in_one_round() -> None:
    machine, done = Machine(), list[str]()
    names = ("driver", "estimation", "reference", "control")
    nodes = [machine.node(name) for name in names]
    for before, node in zip(names, nodes[1:], strict=False):
        answering(node, before, node.name, lambda node=node: done.append(node.name))
    host = machine.host(*nodes)
    while host.step():
        pass
    nodes[0].publisher(topics.LOG.of("driver")).put(line(0))
    assert host.step() == 3
    assert done == ["estimation", "reference", "control"]
    assert host.step() == 0


@given(st.lists(st.integers(0, 20), min_size=2, max_size=4))
def test_the_processor_time_of_a_group_is_divided_among_its_nodes(costs: list[int]) -> None:
    machine, reports = Machine(), dict[str, Health]()
    nodes = [machine.node(f"n{k}") for k in range(len(costs))]

    def busy(cost: int) -> None:
        machine.now += cost * MS
        machine.cpu_s += 0.5e-3 * cost  # the processor was somebody else's half of the time

    for node, cost in zip(nodes, costs, strict=True):
        node.every(10.0, lambda _, cost=cost: busy(cost))
    listener = machine.node("listener")
    listener.each(topics.HEALTH, lambda h, _: reports.__setitem__(h.service, h))
    machine.run(machine.host(*nodes, listener), 2500 * MS)
    for node, cost in zip(nodes, costs, strict=True):
        percent = reports[node.name].cpu_percent
        assert percent is not None
        # Ten times a second; the last step may be accounted for later.
        assert abs(percent - 0.5 * cost) <= 0.1 * cost + 1e-9
        assert reports[node.name].rss_mb == 50.0


def test_a_slow_start_of_the_group_is_no_missed_tick_of_the_first() -> None:
    machine, rung = Machine(), list[int]()
    first = machine.node("first")
    first.every(100.0, rung.append)
    machine.now += 1000 * MS  # the second is slow to be wired
    host = machine.host(first, machine.node("second"))
    machine.run(host, 1500 * MS)
    assert first.counts["missed_deadline"] == 0
    assert rung[0] >= 1010 * MS


# A node stepped by two threads: nothing is lost, nothing is handled twice or at once.


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
def stepping(
    loop: Loop,
    failures: list[BaseException] | None = None,
    leaving: Callable[[], None] = lambda: None,
) -> Generator[None]:
    """The service's thread, as a process has it. `leaving` wakes it at its end."""
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
        leaving()
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
def test_each_of_many_messages_is_handled_once_in_order_and_alone(on_arrival: bool) -> None:
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


def test_a_timer_set_by_a_handler_wakes_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POLL_S", 10 * PATIENCE_S)  # it would sleep until then
    rung = threading.Event()
    bench = Bench(lambda _, __: alarm.set(0))
    alarm = bench.node.alarm(lambda _: rung.set())
    with stepping(bench.loop(on_arrival=True), leaving=lambda: bench.say(2)):  # as at first
        bench.say(1)
        assert rung.wait(PATIENCE_S)


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
    assert traceback.extract_tb(failures[0].__traceback__)[-1].name == "handler"
    assert handled == [1, 1]
