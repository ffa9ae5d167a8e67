"""Timers of a service. Pure: the node asks what is due and passes `now`."""

from collections import Counter
from collections.abc import Callable

MISSABLE = 10  # periods of delay after which a tick gives up catching up


NOTHING: Counter[str] = Counter()


class Tick:
    """A fixed rate on absolute deadlines: one late tick does not shift the next."""

    def __init__(self, hz: float, start: int, handler: Callable[[int], None]) -> None:
        self._period = round(1e9 / hz)
        self._handler = handler
        self.due: int | None = None  # [ns]
        self.start(start)

    def start(self, now: int) -> None:
        """Ring for the first time one period after `now` [ns]."""
        self.due = now + self._period

    def ring(self, now: int) -> Counter[str]:
        """Call the handler; returns what is to be counted. After a long stall the missed ticks are
        counted and skipped, instead of being run in a burst."""
        assert self.due is not None
        missed = (now - self.due) // self._period
        if missed > MISSABLE:
            self.due += missed * self._period
        else:
            missed = 0
        self.due += self._period
        self._handler(now)
        return Counter({"missed_deadline": missed}) if missed else NOTHING


class Alarm:
    """A one-shot timer: rings once each time it is set."""

    def __init__(self, handler: Callable[[int], None]) -> None:
        self._handler = handler
        self.due: int | None = None  # [ns]

    def set(self, at: int | None) -> None:
        """Ring at `at` [ns], replacing any earlier setting; None: do not ring."""
        self.due = at

    def ring(self, now: int) -> Counter[str]:
        self.due = None
        self._handler(now)
        return NOTHING
