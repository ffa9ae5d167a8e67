"""Two machines, two clocks: converting the other machine's stamps to local time.

A message's stamps are in the clock of the side that published it. Where topside and drone are two
machines, every node keeps the clock offset that the link monitor publishes, and the gates convert
the stamps of every message that crossed the link to local time. On one machine there is one clock
and nothing to do.

The type of a field decides whether it is a stamp: every field of type `Stamp` (messages/units.py),
or of it and None, is shifted; everything else, including durations and what stands deeper, stays as
it is. A test says of which messages that is not all.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from msgspec import inspect
from msgspec.structs import force_setattr

from messages.link import Clock, ClockPing, ClockPong
from messages.message import Message
from messages.topic import AnyTopic, Direction, Side
from messages.units import STAMP

SILENT_NS = 3_000_000_000  # [ns] a topside says its clock five times a second
SOURCES = 8  # topsides whose clocks are kept
DRIFT = 100e-6  # [-] at most, between two crystals of 50 ppm
ABOUT_CLOCKS = (Clock, ClockPing, ClockPong)  # never converted: they compare the two clocks


@dataclass(frozen=True, slots=True)
class OtherClock:
    """What is known of one clock of the other side."""

    ahead_ns: int | None = None  # [ns] it minus this one; None: not known
    error_ns: int = 0  # [ns] greatest error of `ahead_ns` …
    learnt_ns: int = 0  # [ns] … at this time
    source: int = 0  # whose clock it is
    epoch: int = 0  # authority epoch of the commands that are stamped by it

    def bound_ns(self, now: int) -> int:
        """[ns] Greatest error now; it grows while the link monitor is silent, because two crystals
        drift apart."""
        return self.error_ns + round(DRIFT * max(0, now - self.learnt_ns))


UNKNOWN = OtherClock()


class ClockOffset:
    """What is known of the other side's clock, or clocks: there may be two topsides, each with a
    link monitor of its own. A message that carries an authority epoch is of the topside with that
    epoch; everything else is taken to be of the one with the newest epoch, which is in control."""

    def __init__(self, side: Side) -> None:
        """The side this node is on."""
        self._clocks: dict[int, OtherClock] = {}  # by source, the one heard last at the end
        self._in_force = UNKNOWN
        self._sign = 1 if side == "topside" else -1
        self._crossing = Direction.UP if side == "topside" else Direction.DOWN

    @property
    def ahead_ns(self) -> int | None:
        """[ns] The clock in force minus this one; None: not known."""
        return self._in_force.ahead_ns

    def bound_ns(self, now: int) -> int:
        """[ns] Greatest error of the offset in force."""
        return self._in_force.bound_ns(now)

    def of(self, epoch: int | None) -> OtherClock:
        """The clock behind a message of this authority epoch; None: it carries none."""
        if len(self._clocks) > 1 and epoch is not None and epoch != self._in_force.epoch:
            for clock in reversed(self._clocks.values()):
                if clock.epoch == epoch:
                    return clock
        return self._in_force

    def learn(self, clock: Clock, now: int) -> None:
        """Keep a link monitor's newest message."""
        ahead = clock.offset_ns if clock.bound_ns is not None else None
        learnt = OtherClock(
            ahead_ns=None if ahead is None else self._sign * ahead,
            error_ns=clock.bound_ns or 0,
            learnt_ns=now,
            source=clock.source,
            epoch=clock.epoch,
        )
        self._clocks.pop(clock.source, None)
        self._clocks[clock.source] = learnt
        self._in_force = self._clocks.get(self._in_force.source, UNKNOWN)
        heard = [c for c in self._clocks.values() if now - c.learnt_ns <= SILENT_NS]
        self._clocks = {c.source: c for c in heard[-SOURCES:]}
        if self._in_force not in heard or any(c.epoch > self._in_force.epoch for c in heard):
            self._in_force = max(reversed(heard), key=lambda c: c.epoch)

    def concerns(self, topic: AnyTopic) -> bool:
        """Does this topic come from the other machine?"""
        return topic.way is self._crossing and topic.message not in ABOUT_CLOCKS

    def local_ns(self, topic: AnyTopic, stamp_ns: int) -> int | None:
        """[ns] A stamp of this topic by the clock of this side; None where that is not known: not
        yet, or because the topic is published on both sides."""
        if topic.way is Direction.BOTH:
            return None
        if topic.way is not self._crossing:
            return stamp_ns
        return None if self.ahead_ns is None else stamp_ns - self.ahead_ns

    def judges(self, topic: AnyTopic) -> bool:
        """Can its stamps be checked? Topics published on both sides may be of either clock."""
        return topic.way is not Direction.BOTH and topic.message not in ABOUT_CLOCKS


@cache
def mover(kind: type[Message]) -> Callable[[Message, int], None]:
    """A function that subtracts `ahead_ns` [ns] from every stamp of a message just decoded.

    Made once for each message type, because thousands of messages are converted every second.
    """
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    names = tuple(field.name for field in info.fields if _is_stamp(field.type))

    def move(message: Message, ahead_ns: int) -> None:
        # Frozen for everybody else; nobody else has it yet.
        for name in names:
            moment = getattr(message, name)
            if moment is not None:
                force_setattr(message, name, moment - ahead_ns)

    return move


def _is_stamp(kind: inspect.Type) -> bool:
    if isinstance(kind, inspect.UnionType):
        return any(map(_is_stamp, kind.types))
    return isinstance(kind, inspect.Metadata) and kind.extra == STAMP
