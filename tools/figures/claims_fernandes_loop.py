"""What Fernandes et al. 2015 say of the errors of 4.1 and 4.3, against Minerva in the whole stack.

The flights take a minute and a half, so their claims are made only when their figures are drawn.
"""

from collections.abc import Callable
from math import degrees

from tools.figures.claims import Claim, judged, not_computed
from tools.figures.fernandes_loop import (
    SURVEY_LIMITS,
    TRIAL_LIMITS,
    Limits,
    Pair,
    surveys,
    trials,
)

GOAL = 0.5  # [-] of what the paper says
WATER = "current, hull and umbilical are ours, see tools/figures/fernandes_loop_flight.py"
PAPERS_WAY = f"the paper's law, gains, reference model and path, our estimator; {WATER}"
OUR_WAY = f"goal: half of what the paper says; {WATER}"
COMPASS = "the compass: its hard iron is not measured, and no law can know better"


def trial_claims() -> list[Claim]:
    return _claims("4.1", TRIAL_LIMITS, trials())


def survey_claims() -> list[Claim]:
    return _claims("4.3", SURVEY_LIMITS, surveys())


def trial_not_flown() -> list[Claim]:
    return _claims("4.1", TRIAL_LIMITS, None)


def survey_not_flown() -> list[Claim]:
    return _claims("4.3", SURVEY_LIMITS, None)
