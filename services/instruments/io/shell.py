"""A driver of an instrument on its port and on the bus."""

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, TypeVar

from messages import events
from messages.message import Message
from messages.topic import Topic
from messages.units import Ns
from services.instruments.watch import InstrumentWatch
from services.mavlink_io.io.links import ByteLinks, FarEndLimits, Links
from services.runtime.node.node import Node

LOOK_HZ = 10.0  # [1/s] what is due is sent; what arrives is handled at once
M = TypeVar("M", bound=Message, covariant=True)
P = TypeVar("P", bound=Message)


class InstrumentDriver(Protocol[M]):
    """What thinks: bytes in; samples, requests and events out."""

    watch: InstrumentWatch

    def heard(self, pieces: Iterable[bytes], arrival: Ns) -> Sequence[M]:
        """Samples in what has arrived at `arrival` [ns]."""
        ...

    def due(self, now: Ns) -> Sequence[bytes]:
        """What is to be sent at `now` [ns]."""
        ...


class InstrumentLinks(ByteLinks, Protocol):
    """As of `Links`."""

    def again(self, why: str) -> None: ...


def limits_of(name: str) -> FarEndLimits:
    """Of several that send datagrams, the instrument is the one that speaks first."""
    lost = events.DROPPED(name)
    return FarEndLimits(1, 3.0, beyond=events.STRANGER(name), dropped=lost)


def exchange(
    links: InstrumentLinks, driver: InstrumentDriver[P], clock: Callable[[], Ns], now: Ns
) -> list[P]:
    """One look at the links: what arrives is handed to the driver, what is due is sent."""
    samples = list[P]()
    for _, pieces, _ in links.receive():
        # Not `now`: on a busy computer, what was sent since then may have arrived as well.
        samples += driver.heard(pieces, clock())
    for request in driver.due(now):
        for name in links.names:
            links.send(name, request)
    if driver.watch.gives_up(now, links.trouble):
        links.again("silent")
    return samples


def connect(node: Node, url: str, driver: InstrumentDriver[P], topic: Topic[P]) -> None:
    """
    Raises:
        LindyError: the URL is none that is allowed, or its port cannot be opened.
    """
    links = Links([url], f"{node.name}.url", limits_of(driver.watch.name), node.outbox)
    publisher = node.publisher(topic)

    def look(now: Ns) -> None:
        for sample in exchange(links, driver, node.now, now):
            publisher.put(sample)

    node.every(LOOK_HZ, look)
    node.on_close(links.close)
    links.start(node.from_outside(look))
