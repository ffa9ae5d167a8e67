"""CoDel: keeps the waiting time in a queue short without knowing the link's rate.

Nichols & Jacobson 2012, *Controlling queue delay*; RFC 8289 section 4. A queue that has not once
been shorter than `target` for a whole `interval` drops messages as they leave, ever faster.
"""

from math import sqrt
from typing import Annotated

import msgspec

Wait = Annotated[float, msgspec.Meta(gt=0.0, le=10_000.0)]


class CoDel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    target_ms: Wait = 5.0  # [ms] acceptable wait; no less than the largest message takes
    interval_ms: Wait = 100.0  # [ms] about the longest round trip

    def __post_init__(self) -> None:
        if self.target_ms > self.interval_ms:
            raise ValueError(
                f"target_ms is {self.target_ms:g}, expected at most interval_ms "
                f"{self.interval_ms:g}"
            )


class Dropper:
    """The state of CoDel for one queue."""

    def __init__(self, law: CoDel) -> None:
        self._target = round(law.target_ms * 1e6)  # [ns]
        self._interval = round(law.interval_ms * 1e6)  # [ns]
        self._above_at: int | None = None  # [ns] when too long a wait will have lasted an interval
        self._dropping = False
        self._next = 0  # [ns] of the next drop
        self._count = 0  # drops since dropping began
        self._last_count = 0  # as it was when dropping began the last time

    def drops(self, waited: int, alone: bool, now: int) -> bool:
        """Is the message that would leave at `now` [ns], after `waited` [ns], dropped instead?

        Args:
            alone: nothing waits behind it; the last message is never dropped.
        """
        lasting = self._lasting(waited, alone, now)
        if not self._dropping:
            if lasting:
                self._begin(now)
            return lasting
        if not lasting:
            self._dropping = False
            return False
        if now < self._next:
            return False
        self._count += 1
        self._next = self._control(self._next)
        return True

    def _lasting(self, waited: int, alone: bool, now: int) -> bool:
        """Has the wait been above the target for an interval?"""
        if waited < self._target or alone:
            self._above_at = None
            return False
        if self._above_at is None:
            self._above_at = now + self._interval
            return False
        return now >= self._above_at

    def _begin(self, now: int) -> None:
        """Start dropping; soon after the last time, go on at the rate that was found then."""
        recent = now - self._next < 16 * self._interval
        gained = self._count - self._last_count
        self._count = gained if recent and gained > 1 else 1
        self._last_count = self._count
        self._dropping = True
        self._next = self._control(now)

    def _control(self, at: int) -> int:
        return at + round(self._interval / sqrt(self._count))
