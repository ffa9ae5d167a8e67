"""A row of measurements says what it is."""

from services.estimation.core import AID_SOURCES
from tools.review.estimated import MEANS, in_words


def test_what_no_owner_knows_is_explained() -> None:
    assert set(MEANS) < {name.partition("_")[0] for name in AID_SOURCES}
    assert in_words("hull_north") == "hull north (level acceleration by thrust and drag)"
    assert in_words("dvl_surge") == "dvl surge"
