"""A driver of an instrument on its port and on the bus, and where north and east count from."""

from collections.abc import Callable, Iterable, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

import msgspec

from messages import events
from messages.events import Outbox
from messages.message import Message
from messages.topic import Topic
from messages.units import Ns
from services.instruments.core import (
    FirstOfTwo,
    GeoPoint,
    InstrumentWatch,
    LocalFixes,
    OriginCheckpoint,
)
from services.mavlink_io.io.links import ByteLinks, FarEndLimits, Links
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

POSITIONS = ("nmea", "ugps")  # services that give positions


class PositionTable(msgspec.Struct, frozen=True):
    """What their tables have in common."""

    url: str = ""
    origin: GeoPoint | None = None


def local_fixes(
    stack: Stack, name: str, instrument: str, outbox: Outbox, node: Node | None
) -> LocalFixes:
    """
    Args:
        name: of the service.
        node: remembers the first position, so that it stays the origin after a crash.

    Raises:
        LindyError: there are two instruments, and it is not said that their origin is the same.
    """
    running = [n for n in POSITIONS if not stack.running or n in stack.running]
    tables = {n: stack.section(n, PositionTable) for n in running}
    origins = {n: table.origin for n, table in tables.items() if table.url}
    if len(origins) > 1 and (None in origins.values() or len({*origins.values()}) > 1):
        found = " and ".join(f"{n}.origin {origin or 'absent'}" for n, origin in origins.items())
        raise LindyError(
            f"{stack.vehicle_path}: found {found}; allowed with two instruments for the position: "
            f"the same origin for both, since both count north and east from it"
        )
    origin = stack.section(name, PositionTable).origin
    if node is None:
        return LocalFixes(instrument, outbox, origin)
    before = node.restore_checkpoint(OriginCheckpoint)
    if origin is None and before is not None:
        origin = before.origin
    return LocalFixes(instrument, outbox, origin, node.save_checkpoint)


LOOK_HZ = 10.0  # [1/s] what is due is sent; what arrives is handled at once
M = TypeVar("M", bound=Message, covariant=True)
P = TypeVar("P", bound=Message)


class InstrumentDriver(Protocol[M]):
    """What thinks: bytes in; samples, requests and events out."""

    watch: InstrumentWatch
    told: str  # what it says of itself now, for people

    def heard(self, pieces: Iterable[bytes], arrival: Ns) -> Sequence[M]:
        """Samples in what has arrived at `arrival` [ns]."""
        ...

    def due(self, now: Ns) -> Sequence[bytes]:
        """What is to be sent at `now` [ns]."""
        ...


class InstrumentLinks(ByteLinks, Protocol):
    """As of `Links`."""

    def again(self, why: str) -> None: ...


class Instrument(NamedTuple, Generic[P]):
    driver: InstrumentDriver[P]
    links: InstrumentLinks


# Of a service with the name in a stack, whose events go to the outbox; None: it has no url.
Opens = Callable[[Stack, str, Outbox], Instrument[P] | None]


def on_links(
    url: str, name: str, driver: InstrumentDriver[P], outbox: Outbox
) -> Instrument[P] | None:
    """
    Raises:
        LindyError: the URL is none that is allowed, or its port cannot be opened.
    """
    if not url:
        return None
    links = Links([url], f"{name}.url", limits_of(driver.watch.name), outbox)
    return Instrument(driver, links)


def limits_of(name: str) -> FarEndLimits:
    """Of several that send datagrams, the instrument is the one that speaks first."""
    lost = events.DROPPED(name)
    return FarEndLimits(1, 3.0, beyond=events.STRANGER(name), dropped=lost, patient=True)


def exchange(instrument: Instrument[P], clock: Callable[[], Ns], now: Ns) -> list[P]:
    """One look at the links: what arrives is handed to the driver, what is due is sent."""
    driver, links = instrument
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


def connect(
    node: Node,
    stack: Stack,
    opens: Opens[P],
    topic: Topic[P],
    measures: Callable[[P], bool] = lambda _: True,
    other: str = "",
) -> None:
    """An instrument without a url is none, and nothing is done.

    Args:
        measures: a sample says more than that nothing is measured.
        other: as of `FirstOfTwo`.

    Raises:
        LindyError: as of `opens`; or time is virtual.
    """
    if stack.virtual:
        raise NeedsRealTimeError(node.name)
    if (instrument := opens(stack, node.name, node.outbox)) is None:
        return
    publisher = node.publisher(topic)
    first = FirstOfTwo(instrument.driver.watch.name, node.outbox, other)

    def look(now: Ns) -> None:
        for sample in exchange(instrument, node.now, now):
            if first.uses_own(now, measured=measures(sample)):
                publisher.put(sample)

    def hear_other(sample: P, now: Ns) -> None:
        if measures(sample):
            first.heard_other(now)

    node.each(topic, hear_other)
    node.every(LOOK_HZ, look)
    node.on_close(instrument.links.close)
    instrument.links.start(node.from_outside(look))
