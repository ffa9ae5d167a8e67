"""The ring between two threads: nothing waits unheard, and nothing is lost uncounted."""

import sys
import threading
from collections import Counter, deque

import pytest

from messages.events import Outbox
from services.runtime.bus.envelope import Envelope
from services.runtime.node.ports import Inbox
from tests.support.patience import PATIENCE_S


def envelope(number: int) -> Envelope:
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
    inbox.store(envelope(1))
    inbox.store(envelope(2))
    meanwhile = True
    inbox.store(envelope(3))
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
    inbox.store(envelope(1))
    inbox.store(envelope(2))
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
            inbox.store(envelope(number))
        assert len(told) == round_
        assert [e.key for _, e in inbox.take_all()] == ["6", "7", "8", "9"]
    assert counts == {"overflowed:x": 18}


@pytest.mark.parametrize("depth", [1, 2, 8])
def test_two_threads_lose_nothing_that_is_not_counted(depth: int) -> None:
    """The service sleeps until it is told, as a process does: one lost word and it hangs."""
    number, counts, taken = 20_000, Counter[str](), list[int]()
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
            inbox.store(envelope(k))
        service.join(2 * PATIENCE_S)
    finally:
        sys.setswitchinterval(switching)
    assert not service.is_alive()
    assert taken[-1] == number - 1
    assert taken == sorted(set(taken))
    assert len(taken) + counts["overflowed:x"] == number == inbox.stored
