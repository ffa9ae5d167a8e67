"""Loss models: which messages never arrive."""

from typing import Annotated

import msgspec

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


class Losses:
    """Decides message by message. The state of a Gilbert–Elliott link begins good."""

    def __init__(self, loss: Loss | None, random: UniformStream) -> None:
        self._loss = loss
        self._random = random
        self._bad = False

    def reason(self, seconds: float) -> str | None:
        """Why the next message is lost, `loss` or `burst`; None: it is not.

        Args:
            seconds: [s] since the link began.
        """
        match self._loss:
            case None:
                return None
            case Independent(share):
                return "loss" if self._random.happens(share) else None
            case GilbertElliott() as model:
                return self._two_states(model)
            case Bursts() as model:
                since = seconds - model.first_s
                within = since >= 0.0 and since % model.every_s < model.seconds
                return "burst" if within and self._random.happens(model.share) else None

    def _two_states(self, model: GilbertElliott) -> str | None:
        if self._random.happens(model.to_good if self._bad else model.to_bad):
            self._bad = not self._bad
        share = model.loss_bad if self._bad else model.loss_good
        if not self._random.happens(share):
            return None
        return "burst" if self._bad else "loss"
