"""One direction of the link, as the tether service uses it, with counts of what was not carried."""

from collections.abc import Callable
from typing import Generic, TypeVar

from messages.units import Ns
from services.tether.link_model import LinkDirection

T = TypeVar("T")
Admits = Callable[[str, int, Ns], bool]  # (key, size [B], now): not thinned out?


def everything(_key: str, _size: int, _now: Ns) -> bool:
    """Nothing is thinned out."""
    return True


class Crossing(Generic[T]):
    """`counts` collects what must be counted."""

    def __init__(self, line: LinkDirection[tuple[str, T]], admits: Admits = everything) -> None:
        self.counts: list[str] = []
        self._line = line
        self._admits = admits

    def enter(
        self, key: str, item: T, size: int, rank: int, now: Ns, life: Ns | None = None
    ) -> None:
        """`size` [B] of a message on a key; `rank` as in `priority_queue.RANK`, `life` as in a
        `Packet`."""
        if self._admits(key, size, now):
            self._line.enter((key, item), now, size, rank, life)
        else:
            self.counts.append(f"thinned:{key}")

    def leave(self, now: Ns) -> list[tuple[T, bool]]:
        """The messages that have arrived, and whether each was damaged on the link."""
        arrived: list[tuple[T, bool]] = []
        while (arrival := self._line.leave(now)) is not None:
            key, item = arrival.item
            if arrival.damaged:
                self.counts.append(f"damaged:{key}")
            arrived.append((item, arrival.damaged))
        if lost := self._line.take_lost():
            self.counts += [f"{reason}:{key}" for (key, _), reason in lost]
        return arrived

    def due(self) -> Ns | None:
        """[ns] When the next message leaves or is lost; None: there is none on the link."""
        return self._line.due()
