"""What Fernandes et al. 2015 say of the errors of 4.1 and 4.3, against Minerva in the whole stack.

The flights take a minute and a half, so their claims are made only when their figures are drawn.
"""

from collections.abc import Callable, Iterator
from math import degrees
from typing import NamedTuple

from lindy_research.papers.claims import Claim, judged, not_computed
from lindy_research.papers.fernandes_loop import (
    SURVEY_LIMITS,
    TRIAL_LIMITS,
    PaperLimits,
    RoutePair,
    surveys,
    trials,
)
from lindy_research.papers.fernandes_loop_flight import LoopRun

PAPER = "Fernandes et al. 2015"
GOAL = 0.5  # [-] of what the paper says
WATER = (
    "current, hull and umbilical (there in 4.1, left out in 4.3, where it would decide) are ours: "
    "research/lindy_research/papers/fernandes_loop_flight.py"
)
UNITS = ("m", "m", "°")
NAMES = ("path", "depth", "heading")
WHY = (
    "the umbilical, or what the law does not learn of it in time",
    "the law does not hold the depth",
    "the compass: its deviation shows only under way, and no law can know better",
)


class FlownSection(NamedTuple):
    """A section of the paper that is flown."""

    section: str
    figures: tuple[str, ...]  # ids of its figures; drawing any of them computes the claims
    limits: PaperLimits
    flights: Callable[[], RoutePair]


FLOWN = (
    FlownSection("4.1", ("fernandes-6", "fernandes-7", "fernandes-8"), TRIAL_LIMITS, trials),
    FlownSection(
        "4.3",
        ("fernandes-14", "fernandes-15", "fernandes-16", "fernandes-17"),
        SURVEY_LIMITS,
        surveys,
    ),
)


def flown_claims(what: FlownSection) -> list[Claim]:
    """Computed from flights."""
    paper, lindy = what.flights()
    return [*_judged(what, "", paper, 1.0), *_judged(what, "-lindy", lindy, GOAL)]


def claims_not_flown(what: FlownSection) -> list[Claim]:
    """The same claims where no figure of them is drawn."""
    note = f"needs flights of a minute; computed when {what.figures[0]} is drawn"
    return [
        not_computed(
            _id(what, k, way), _source(what), _claim(k, way), share * limit, UNITS[k], note
        )
        for way, share in (("", 1.0), ("-lindy", GOAL))
        for k, limit in enumerate(what.limits)
    ]


def _judged(what: FlownSection, way: str, flight: LoopRun, share: float) -> Iterator[Claim]:
    path, depth, heading = flight.worst()
    ours = path, depth, degrees(heading)
    for k, limit in enumerate(what.limits):
        yield judged(
            _id(what, k, way), _source(what), _claim(k, way), share * limit, ours[k], UNITS[k],
            0.0, "at most", why=WHY[k], note=WATER,
        )  # fmt: skip


def _id(what: FlownSection, k: int, way: str) -> str:
    return f"fernandes-{what.section}-{NAMES[k]}-error{way}"


def _source(what: FlownSection) -> str:
    return f"{PAPER}, {what.section}"


def _claim(k: int, way: str) -> str:
    if way:
        return f"largest {NAMES[k]} error under way with Lindy's law, goal: half of the paper's"
    return f"largest {NAMES[k]} error under way with the paper's law and our estimator"
