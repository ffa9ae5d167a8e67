"""A row of beliefs is there for what was recorded, and says what it is."""

from collections import Counter

import numpy as np

from services.estimation.aiding import AID_SOURCES
from tools.review.beliefs import MEANS, THRUST, believed, in_words, shown
from tools.review.estimated import Belief

ONE = np.ones(3)
BELIEFS = {
    name: Belief(ONE, ONE, ONE, ONE, ONE, ONE, 0.0 * ONE, Counter(), Counter(), "m")
    for name in AID_SOURCES
}


def test_thrust_is_believed_only_where_it_was_recorded() -> None:
    assert [each.name for each in believed(shown(BELIEFS, has_thrust=True))] == list(AID_SOURCES)
    without = shown(BELIEFS, has_thrust=False)
    assert set(AID_SOURCES) - set(without) == {n for n in AID_SOURCES if n.startswith(THRUST)}


def test_what_no_owner_knows_is_explained() -> None:
    assert set(MEANS) == {n for n in AID_SOURCES if n == "trial" or n.startswith(THRUST)}
    assert in_words("trial") == "trial (pressure, by a second filter without the accelerometer)"
    assert in_words("gyroscope_roll") == "gyroscope roll"
