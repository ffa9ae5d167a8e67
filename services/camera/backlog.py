"""What has been read of a camera and waits for the decoder. Pure: time is an argument.

It is read without a pause, so that nothing waits where nobody counts it. A keyframe makes all
before it needless; what has waited too long makes all up to the next keyframe needless.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from messages.units import Ns

P = TypeVar("P")
# [ns] A decoder so far behind catches up with the next keyframe only.
LONGEST_WAIT_NS = 500_000_000


@dataclass(slots=True)
class Backlog(Generic[P]):
    """Packets of one source, in their order."""

    dropped: int = 0  # packets, since it was opened
    _waiting: deque[tuple[Ns, P]] = field(default_factory=lambda: deque[tuple[Ns, P]]())
    _broken: bool = False  # nothing can be decoded before the next keyframe

    def put(self, packet: P, now: Ns, *, keyframe: bool) -> None:
        """A packet has arrived."""
        if keyframe:
            self._drop()
            self._broken = False
        elif self._waiting and now > self._waiting[0][0] + LONGEST_WAIT_NS:
            self._drop()
            self._broken = True
        if self._broken:
            self.dropped += 1
        else:
            self._waiting.append((now, packet))

    def take(self) -> P | None:
        """The next packet to decode; None: there is none."""
        return self._waiting.popleft()[1] if self._waiting else None

    def _drop(self) -> None:
        self.dropped += len(self._waiting)
        self._waiting.clear()
