"""Loss models and outages: which messages never arrive."""

from itertools import pairwise
from typing import Annotated

import msgspec

from messages import events
from messages.events import Row
from messages.units import Share
from services.tether.random_streams import UniformStream

UpToADay = Annotated[float, msgspec.Meta(ge=0.0, le=86_400.0)]
Period = Annotated[float, msgspec.Meta(gt=0.0, le=86_400.0)]


class Independent(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="independent"
):
    """Each message independently of the others."""

    share: Share  # [-]


class GilbertElliott(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="gilbert_elliott"
):
    """A link with a good and a bad state; it may change before every message.

    Gilbert 1960, *Capacity of a burst-noise channel*; Elliott 1963, *Estimates of error rates for
    codes on burst-noise channels*.
    """

    to_bad: Share  # [-] of the messages in the good state: the link turns bad
    to_good: Share  # [-] of the messages in the bad state: the link turns good
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


class Bursts(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="bursts"
):
    """Losses at fixed times, as from a starting thruster or a rotating radar."""

    every_s: Period  # [s] from the beginning of one burst to that of the next
    seconds: UpToADay  # [s] each
    share: Share = 1.0  # [-] of the messages within a burst
    first_s: UpToADay = 0.0  # [s] when the first one begins

    def __post_init__(self) -> None:
        if self.seconds > self.every_s:
            raise ValueError(
                f"seconds is {self.seconds:g}, expected at most every_s {self.every_s:g}"
            )


Loss = Independent | GilbertElliott | Bursts


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
    """Decides message by message. The state of a Gilbert–Elliott link begins good."""

    def __init__(self, loss: Loss | None, random: UniformStream) -> None:
        self._loss = loss
        self._random = random
        self._bad = False

    def reason(self, seconds: float) -> Row | None:
        """Why the next message is lost; None: it is not.

        Args:
            seconds: [s] since the link began.
        """
        match self._loss:
            case None:
                return None
            case Independent(share):
                return events.LOSS if self._random.happens(share) else None
            case GilbertElliott() as model:
                return self._two_states(model)
            case Bursts() as model:
                since = seconds - model.first_s
                within = since >= 0.0 and since % model.every_s < model.seconds
                return events.BURST if within and self._random.happens(model.share) else None

    def _two_states(self, model: GilbertElliott) -> Row | None:
        if self._random.happens(model.to_good if self._bad else model.to_bad):
            self._bad = not self._bad
        share = model.loss_bad if self._bad else model.loss_good
        if not self._random.happens(share):
            return None
        return events.BURST if self._bad else events.LOSS
