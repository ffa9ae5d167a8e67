"""What each sensor was believed, and why not more."""

from collections.abc import Mapping

import msgspec
import numpy as np

from messages.events import sentence
from tools.review.estimated import Belief

THRUST = "thrust_"
OF_THRUST = "speed that the thrust means"
MEANS = {
    "trial": "pressure, by a second filter without the accelerometer",
    **{f"{THRUST}{way}": OF_THRUST for way in ("surge", "sway", "north", "east")},
}


class Believed(msgspec.Struct, kw_only=True, frozen=True):
    """One measured quantity over the dive."""

    name: str
    samples: int
    weight: float  # [-] mean of the compared samples; 1 whole
    refused: float  # [-] share of all samples
    lag_one: float | None  # [-] correlation of each innovation with the next; None: too few
    spread_ratio: float | None  # [-] innovations over what was expected of them; None: none
    distrusted: float  # [-] share of its messages in which the sensor was not trusted
    reasons: dict[str, int]  # event: messages with samples that were refused for it
    words: list[str]  # the same events as sentences


def shown(beliefs: Mapping[str, Belief], has_thrust: bool) -> dict[str, Belief]:
    """Those that the recording had anything for: a drone whose thrusters are not in it has none."""
    return {n: b for n, b in beliefs.items() if has_thrust or not n.startswith(THRUST)}


def believed(beliefs: Mapping[str, Belief]) -> list[Believed]:
    return [_believed(name, belief) for name, belief in beliefs.items()]


def in_words(name: str) -> str:
    """What a row is called on the page."""
    words = name.replace("_", " ")
    return f"{words} ({MEANS[name]})" if name in MEANS else words


def _believed(name: str, belief: Belief) -> Believed:
    compared = np.isfinite(belief.innovation)
    weight = float(np.mean(belief.weight[compared])) if compared.any() else 0.0
    events = dict([*belief.reasons.most_common(), *belief.verdicts.most_common()])
    return Believed(
        name=name,
        samples=int(belief.samples.sum()),
        weight=round(weight, 4),
        refused=round(float(np.average(belief.rejected, weights=belief.samples)), 4),
        lag_one=_rounded(belief.lag_one),
        spread_ratio=_rounded(belief.spread_ratio),
        distrusted=round(belief.verdicts.total() / len(belief.t), 4),
        reasons=dict(belief.reasons.most_common()),
        words=[sentence(event) for event in events],  # the commonest first
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
