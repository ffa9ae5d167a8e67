"""How well each measurement fitted the estimate."""

from collections.abc import Mapping

import msgspec

from messages.events import sentence
from tools.review.estimated import Innovations

MEANS = {
    "hull": "level acceleration by thrust and drag",
    "rest": "gyroscope's bias at rest",
}


class Measurement(msgspec.Struct, kw_only=True, frozen=True):
    """One measured quantity over the dive."""

    name: str
    samples: int
    rejected: float  # [-] share of all samples
    lag_one: float | None  # [-] correlation of each innovation with the next; None: too few
    spread_ratio: float | None  # [-] innovations over what was expected of them; None: none
    not_used: float  # [-] share of its messages in which the sensor was not used
    reasons: dict[str, int]  # event: messages with samples that were rejected for it
    words: list[str]  # the same events as sentences


def measurements(found: Mapping[str, Innovations]) -> list[Measurement]:
    return [_measurement(name, each) for name, each in found.items()]


def in_words(name: str) -> str:
    """What a row is called on the page."""
    words, means = name.replace("_", " "), MEANS.get(name.partition("_")[0])
    return f"{words} ({means})" if means else words


def _measurement(name: str, found: Innovations) -> Measurement:
    events = dict([*found.reasons.most_common(), *found.verdicts.most_common()])
    return Measurement(
        name=name,
        samples=int(found.samples.sum()),
        rejected=round(found.share_rejected, 4),
        lag_one=_rounded(found.lag_one),
        spread_ratio=_rounded(found.spread_ratio),
        not_used=round(found.verdicts.total() / len(found.t), 4),
        reasons=dict(found.reasons.most_common()),
        words=[sentence(event) for event in events],  # the commonest first
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
