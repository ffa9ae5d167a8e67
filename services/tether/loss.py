"""Loss models and outages: which messages never arrive."""

from itertools import pairwise
from typing import Annotated

import msgspec

from messages import events
from messages.events import Row
from messages.units import Share
from services.tether.delay import UniformStream

UpToADay = Annotated[float, msgspec.Meta(ge=0.0, le=86_400.0)]
Period = Annotated[float, msgspec.Meta(gt=0.0, le=86_400.0)]


class Loss(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A link with a good and a bad state; it may change before every message. One that never turns
    bad loses each message independently of the others.

    Gilbert 1960, *Capacity of a burst-noise channel*; Elliott 1963, *Estimates of error rates for
    codes on burst-noise channels*.
    """

    to_bad: Share = 0.0  # [-] of the messages in the good state: the link turns bad
    to_good: Share = 1.0  # [-] of the messages in the bad state: the link turns good
    loss_bad: Share = 1.0  # [-] of the messages in the bad state
    loss_good: Share = 0.0  # [-] of the messages in the good state

    def __post_init__(self) -> None:
        if self.to_good == 0.0 and self.to_bad > 0.0:
            raise ValueError("to_good is 0, expected more: the link would stay bad for ever")

    @property
    def mean(self) -> float:
        """[-] Share of all messages that is lost in the long run."""
        both = self.to_bad + self.to_good
        if both == 0.0:
            return self.loss_good
        return (self.to_good * self.loss_good + self.to_bad * self.loss_bad) / both


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


class Losses:
    """Decides message by message. The link begins in its good state."""

    def __init__(self, loss: Loss, random: UniformStream) -> None:
        self._loss = loss
        self._random = random
        self._bad = False

    def reason(self) -> Row | None:
        """Why the next message is lost; None: it is not."""
        loss = self._loss
        if self._random.happens(loss.to_good if self._bad else loss.to_bad):
            self._bad = not self._bad
        if not self._random.happens(loss.loss_bad if self._bad else loss.loss_good):
            return None
        return events.BURST if self._bad else events.LOSS
