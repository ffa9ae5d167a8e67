"""The camera's stream on its way to the pages: whole access units as binary messages, and which of
them a page is sent."""

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from messages import events
from messages.events import Outbox
from messages.units import Ns
from messages.video import UnitStream, VideoPart

VERSION, KEYFRAME, EXACT, STRIPE = 1, 1, 2, 4  # first byte of a message; flags of its second
# Version, flags, two bytes of nothing, number, and when the light arrived (unless EXACT, then or
# earlier) [ms] by the service's clock; the access unit follows (H.264, Annex B). Little-endian.
HEADER = struct.Struct("<BBxxId")
LATE_NS = 600_000_000  # [ns] a page that has not dealt with a picture by then is too slow
MOST_KEPT = 1_000_000  # [B] since the newest keyframe, for pages that are opened later


class PageUnit(NamedTuple):
    """One picture, as every page is sent it."""

    number: int
    keyframe: bool
    message: bytes


class PictureStream:
    """The pictures of a camera that can be decoded, with their numbers."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox, self._units, self._number = outbox, UnitStream(), 0

    def take(self, part: VideoPart) -> PageUnit | None:
        """The picture that this part completes, unless one that it builds on is missing."""
        breaks = self._units.breaks
        unit = self._units.take(part)
        self._outbox.tell(events.BROKEN_PAGE_VIDEO(), self._units.breaks - breaks)
        if unit is None:
            return None
        self._number += 1
        flags = KEYFRAME * part.keyframe | EXACT * part.exact | STRIPE * part.stripe
        head = HEADER.pack(VERSION, flags, self._number, part.stamp_ns / 1e6)
        return PageUnit(self._number, part.keyframe, head + unit.data)


class RecentUnits:
    """Everything since the newest keyframe, so that a page that is opened has a picture at once."""

    def __init__(self) -> None:
        self._units: list[PageUnit] = []
        self._size = 0  # [B]

    def add(self, unit: PageUnit) -> None:
        if unit.keyframe:
            self._units, self._size = [], 0
        elif not self._units:
            return  # the keyframe is no longer kept
        self._units.append(unit)
        self._size += len(unit.message)
        if self._size > MOST_KEPT:
            self._units = []

    def __iter__(self) -> Iterator[PageUnit]:
        return iter(self._units)


@dataclass(slots=True)
class PageVideo:
    """Which pictures one page is sent. It confirms each that it has decoded, or given up: what it
    has not confirmed is under way, wherever that may be. Nothing is kept for it: a page that is too
    slow gets no picture until it has caught up and there is a keyframe."""

    _under_way: deque[tuple[int, Ns]] = field(default_factory=deque[tuple[int, Ns]])
    _broken: bool = True  # it can decode nothing before the next keyframe

    def admits(self, unit: PageUnit, now: Ns) -> bool:
        """Is it sent this picture? If so, it is under way from `now` [ns] on."""
        if self._under_way and now > self._under_way[0][1] + LATE_NS:
            self._broken = True
            return False
        if self._broken and not unit.keyframe:
            return False
        self._broken = False
        self._under_way.append((unit.number, now))
        return True

    def confirmed(self, number: int) -> bool:
        """It has dealt with this picture and all before it. False: it was never sent it."""
        numbers = [sent for sent, _ in self._under_way]
        if number not in numbers:
            return False
        for _ in range(numbers.index(number) + 1):
            self._under_way.popleft()
        return True
