"""When a drone was not heard while it was recorded, and was not expected to be silent. Pure."""

from messages.units import Ns

SILENT_NS: Ns = 3_000_000_000  # a drone says its status five times a second


class Gaps:
    """Of one drone, from its first message on."""

    def __init__(self, now: Ns) -> None:
        self.left_ns: Ns | None = None  # when it took its leave; None: it is expected to be heard
        self._heard_ns = now
        self._ended, self._ended_ns = 0, 0  # gaps that ended, and how long they were together
        self._open_ns: Ns = 0  # of the gap that goes on; 0: it is heard

    def hear(self, now: Ns) -> Ns:
        """A message came. Returns how long the gap was that it ends; 0: there was none."""
        gap = self._end_gap(now)
        self._heard_ns = max(self._heard_ns, now)
        if self.left_ns is not None and now - self.left_ns > SILENT_NS:
            self.left_ns = None  # it is back; what comes sooner may have been said before it left
        return gap

    def leave(self, now: Ns) -> None:
        """It says that it ends: it is not missed until it is heard again."""
        self._end_gap(now)
        self.left_ns = now

    def look(self, now: Ns) -> bool:
        """Has it fallen silent since the last look?"""
        before, self._open_ns = self._open_ns, self._since(now)
        return self._open_ns > 0 and before == 0

    @property
    def count(self) -> int:
        """Also the one that goes on."""
        return self._ended + (self._open_ns > 0)

    @property
    def total_ns(self) -> Ns:
        """All of them together, until the last look."""
        return self._ended_ns + self._open_ns

    @property
    def words(self) -> str:
        """`2 gaps, 14 s in all`; empty: there was no gap."""
        if not self.count:
            return ""
        gaps = "1 gap" if self.count == 1 else f"{self.count} gaps"
        return f"{gaps}, {self.total_ns / 1e9:.0f} s in all"

    def _end_gap(self, now: Ns) -> Ns:
        """Returns how long it was; 0: there was none."""
        gap, self._open_ns = self._since(now), 0
        if gap:
            self._ended += 1
            self._ended_ns += gap
        return gap

    def _since(self, now: Ns) -> Ns:
        """How long it has been silent; 0: not long enough to be a gap, or it has left."""
        silent = now - self._heard_ns
        return silent if silent > SILENT_NS and self.left_ns is None else 0
