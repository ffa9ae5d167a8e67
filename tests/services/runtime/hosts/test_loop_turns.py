"""Several nodes on one thread: whose turn it is, that nobody starves, and what each costs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import Health, LogLine
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.bus.shared_bus import SharedBus, SharedBusPort
from services.runtime.hosts.loop import Loop
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.loop_stats import Usage
from services.runtime.node.node import Node

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
    return Loop(toys, lambda: usage, on_arrival=False, clock=now, cpu_clock=lambda: 0)


@given(st.data(), NODES)
def test_who_is_ready_waits_for_each_of_the_others_at_most_once(
    data: st.DataObject, count: int
) -> None:
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
def test_all_who_are_ready_are_stepped_once_in_their_order(
    count: int, woken: set[int], again: int
) -> None:
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
    cpu: int = 0  # [ns] of the thread
    network: MemoryBus = field(default_factory=MemoryBus)

    def __post_init__(self) -> None:
        self.bus = SharedBus(MemoryBusPort(self.network))

    def node(self, name: str) -> Node:
        return Node(
            name, {"drone": SharedBusPort(self.bus)}, lambda: self.now, VolatileCheckpoint()
        )

    def host(self, *nodes: Node) -> Loop:
        usage = Usage(cpu_s=7.0, rss_mb=50.0)
        return Loop(
            list(nodes), lambda: usage, on_arrival=False,
            clock=lambda: self.now, cpu_clock=lambda: self.cpu,
        )  # fmt: skip

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


def test_two_nodes_that_keep_waking_each_other_starve_no_timer_of_a_third() -> None:
    machine, rung = Machine(), list[int]()
    ping, pong, third = (machine.node(name) for name in ("ping", "pong", "third"))
    answers = list[int]()

    def take_a_while() -> None:
        machine.now += MS
        answers.append(machine.now)

    answering(ping, hears="b", says="a", then=take_a_while)
    answering(pong, hears="a", says="b", then=take_a_while)
    third.every(100.0, rung.append)
    host = machine.host(ping, pong, third)
    ping.publisher(topics.LOG.of("a")).put(line(0))
    machine.run(host, 1000 * MS)
    assert len(answers) == 1000  # they never rest
    assert len(rung) == 99 or len(rung) == 100
    assert max(late for late in (at % (10 * MS) for at in rung)) <= 2 * MS


def test_a_flood_from_outside_is_handled_in_parts_so_that_the_others_get_their_turns() -> None:
    machine, rung, heard = Machine(), list[int](), list[int]()
    ear, other = machine.node("ear"), machine.node("other")
    say = MemoryBusPort(machine.network).say(topics.LOG.of("flood"))
    payload = msgspec.msgpack.encode(line(0))

    def hear(now: int) -> None:
        heard.append(now)
        machine.now += MS
        say(payload)  # for each that is handled another arrives

    on_line(ear, "flood", hear)
    other.every(1.0, rung.append)
    host = machine.host(ear, other)
    say(payload)
    machine.run(host, 10_000 * MS)
    assert len(heard) >= 10_000
    assert len(rung) >= 9


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
        machine.cpu += cost * MS

    for node, cost in zip(nodes, costs, strict=True):
        node.every(10.0, lambda _, cost=cost: busy(cost))
    listener = machine.node("listener")
    listener.each(topics.HEALTH, lambda h, _: reports.__setitem__(h.service, h))
    machine.run(machine.host(*nodes, listener), 2500 * MS)
    for node, cost in zip(nodes, costs, strict=True):
        percent = reports[node.name].cpu_percent
        assert percent is not None
        assert abs(percent - cost) <= 0.2 * cost + 1e-9  # ten times a second; the last may be later
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
