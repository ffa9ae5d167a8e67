"""Claims: complete, finite, and judged by their stated tolerance only."""

from functools import cache
from math import isfinite, nan, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy_research.papers.catalogue import checked_claims
from lindy_research.papers.claims import UNEXPECTED, Claim, agree, judged

values = st.floats(-1e6, 1e6)


@cache
def all_claims() -> dict[str, Claim]:
    claims = checked_claims()
    assert len({claim.id for claim in claims}) == len(claims)
    return {claim.id: claim for claim in claims}


def test_every_claim_is_complete() -> None:
    for claim in all_claims().values():
        assert claim.source.startswith(("Andrén 2023", "Fernandes et al. 2015"))
        assert claim.claim
        assert claim.unit
        assert len(claim.paper) == len(claim.ours) > 0
        assert all(map(isfinite, (*claim.paper, *claim.ours, claim.tolerance)))
        assert claim.tolerance >= 0


def test_the_verdict_follows_from_the_tolerance_and_a_difference_is_explained() -> None:
    for claim in all_claims().values():
        pairs = zip(claim.paper, claim.ours, strict=True)
        good = all(agree(p, o, claim.comparison, claim.tolerance) for p, o in pairs)
        assert claim.verdict == ("holds" if good else "differs"), claim.id
        assert bool(claim.why) == (claim.verdict == "differs"), claim.id
        assert claim.why != UNEXPECTED, claim.id


@pytest.mark.parametrize(
    ("id_", "ours", "tolerance"),
    [
        ("andren-4.2-peak-acceleration", [25 * sqrt(6)], 1e-9),
        ("andren-4.2-duration", [100 * (sqrt(1.5) - 1)], 1e-9),
        ("andren-4.3-filter-jerk", [100.0], 1e-9),
        ("andren-5.2-design-jerk", [1 + 2 * sqrt(2)], 1e-6),
        ("andren-5.2-design-jerk-bounded", [1.0], 1e-12),
        ("andren-5.2.2-property-2", [1 + sqrt(2)], 1e-3),
        ("andren-5.8-property-1", [4.614926141849354], 1e-5),
        ("andren-5.18-chatter", [0.00125], 1e-12),
        ("fernandes-24-arrival-as-printed", [50 + 2.42132958732e-5], 1e-12),
        ("fernandes-table-3-cruise", [0.3741934753], 1e-6),
        ("fernandes-3-longer", [105.40662153734587], 1e-9),
        ("fernandes-table-2-times", [15.0, 78.2592613, 128.2592613, 224.4375854], 1e-4),
        ("fernandes-5-shorter", [29.11392340], 1e-6),
    ],
)
def test_our_values_are_those_of_an_independent_calculation(
    id_: str, ours: list[float], tolerance: float
) -> None:
    assert all_claims()[id_].ours == pytest.approx(ours, abs=tolerance)


def test_what_differs_is_what_the_papers_get_wrong() -> None:
    differing = {claim.id for claim in all_claims().values() if claim.verdict == "differs"}
    assert differing >= {
        "andren-4.2-duration",
        "andren-5.2-design-jerk",
        "andren-5.9-property-1",
        "andren-5.20-snap",
        "fernandes-24-arrival-as-printed",
        "fernandes-table-3-cruise",
        "fernandes-yaw-smooth",
    }
    assert not {id_ for id_ in differing if id_.endswith(("-bounded", "-option"))}


@settings(max_examples=100, deadline=None)
@given(paper=values, ours=values, tolerance=st.floats(0, 1e6))
def test_equal_means_within_the_tolerance_on_both_sides(
    paper: float, ours: float, tolerance: float
) -> None:
    holds = judged("x", "s", "c", paper, ours, "-", tolerance).verdict == "holds"
    assert holds == (abs(ours - paper) <= tolerance)
    assert agree(paper, ours, "at most", tolerance) == (ours <= paper + tolerance)


@pytest.mark.parametrize(("paper", "ours"), [(1.0, nan), ([1.0, 2.0], [1.0])])
def test_what_cannot_be_compared_is_refused(
    paper: float | list[float], ours: float | list[float]
) -> None:
    with pytest.raises(ValueError, match="cannot be compared"):
        judged("x", "s", "c", paper, ours, "-", 0.1)
