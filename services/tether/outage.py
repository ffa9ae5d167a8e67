"""Outages: when the link is interrupted."""

from itertools import pairwise

import msgspec

from services.tether.loss import Period, UpToADay


class Outage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    start_s: UpToADay  # [s] since the link began
    seconds: Period  # [s]

    @property
    def end_s(self) -> float:
        return self.start_s + self.seconds


class Outages(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A schedule of outages. It repeats every `repeat_s`."""

    windows: tuple[Outage, ...] = ()  # ascending
    repeat_s: UpToADay = 0.0  # [s] 0: once only

    def __post_init__(self) -> None:
        for before, after in pairwise(self.windows):
            if after.start_s < before.end_s:
                raise ValueError(
                    f"windows overlap: the outage at {after.start_s:g} s begins before the one at "
                    f"{before.start_s:g} s ends"
                )
        if self.repeat_s and self.windows and self.windows[-1].end_s > self.repeat_s:
            raise ValueError(
                f"repeat_s is {self.repeat_s:g}, expected at least the end of the last outage, "
                f"{self.windows[-1].end_s:g}"
            )

    def touch(self, since_s: float, until_s: float) -> bool:
        """Is there an outage at any moment from `since_s` to `until_s` [s], both included?"""
        if not self.windows:
            return False
        if self.repeat_s == 0.0:
            return any(w.start_s <= until_s and since_s < w.end_s for w in self.windows)
        if until_s - since_s >= self.repeat_s:
            return True
        since = since_s % self.repeat_s
        until = since + (until_s - since_s)
        return any(
            w.start_s + round_s <= until and since < w.end_s + round_s
            for w in self.windows
            for round_s in (0.0, self.repeat_s)
        )
