"""What is expected of every cell, and which cells miss it."""

from collections.abc import Callable
from typing import NamedTuple

from tests.support.faults.catalogue import NONE
from tests.support.faults.fault import FaultCase
from tests.support.faults.figures import STEP_NS, Figures

STEP_S = STEP_NS / 1e9
DEPTH_M = 0.1
JERK = 1.0005  # [-] shown as 1.000
PILOT_S = 0.3 + STEP_S
THRUST_S = 0.25


class Goal(NamedTuple):
    name: str
    words: str  # for the page
    met: Callable[[FaultCase, Figures], bool | None]  # None: there is nothing to judge


def _depth(fault: FaultCase, figures: Figures) -> bool | None:
    if not fault.lives or figures.depth_error is None:
        return None
    return figures.depth_error <= DEPTH_M


def _jerk(_: FaultCase, figures: Figures) -> bool | None:
    return None if figures.jerk_ratio is None else figures.jerk_ratio <= JERK


def _stale(_: FaultCase, figures: Figures) -> bool | None:
    return figures.stale == 0


def _pilot(fault: FaultCase, figures: Figures) -> bool | None:
    return _within(figures.pilot_lost, PILOT_S) if fault.no_pilot else None


def _thrust(fault: FaultCase, figures: Figures) -> bool | None:
    return _within(figures.thrust_zero, THRUST_S) if fault.no_control else None


def _back(fault: FaultCase, figures: Figures) -> bool | None:
    return None if fault.back is None else _within(figures.recovered, fault.back)


def _disarm(_: FaultCase, figures: Figures) -> bool | None:
    return figures.disarmed is not None if figures.asked else None


def _announced(fault: FaultCase, figures: Figures) -> bool | None:
    """Of a thruster nobody can know: no driver measures its thrust."""
    return None if fault is NONE or fault.cause == "thruster" else figures.announced is not None


def _within(seconds: float | None, limit: float) -> bool:
    return seconds is not None and seconds <= limit


GOALS = (
    Goal("depth", "a held depth is held within 0.1 m, where the sensors live", _depth),
    Goal("jerk", "largest jerk of the reference at most 1.000 of its limit", _jerk),
    Goal("stale", "no expired command reaches a thruster", _stale),
    Goal("pilot", "the drone knows within 0.31 s that the pilot is gone", _pilot),
    Goal("thrust", "thrusters stopped within 0.25 s when control ends or hangs", _thrust),
    Goal(
        "back",
        "in control again 1.5 s after a kill, 3 s after a hang, 2 s after what made the drone act "
        "has ended",
        _back,
    ),
    Goal("disarm", "disarm asked for during the fault takes effect", _disarm),
    Goal("announced", "the pilot reads something", _announced),
)


def missed(fault: FaultCase, figures: Figures) -> list[str]:
    """Names of the goals that a cell does not meet."""
    return [goal.name for goal in GOALS if goal.met(fault, figures) is False]
