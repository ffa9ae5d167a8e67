"""What the paper has, and no path here uses."""

from math import radians

import pytest

from lindy_research.papers.fernandes_turns import antisymmetric_end
from lindy_research.papers.unwrapped import accumulate


def test_the_antisymmetric_pair_changes_the_lane_as_in_the_paper() -> None:
    forward, aside = antisymmetric_end(1.7820190659099235, 10.0)
    assert aside == pytest.approx(10.0, abs=1e-12)
    assert forward == pytest.approx(32.91301016270132, abs=1e-12)


def test_headings_accumulate_across_half_a_turn() -> None:
    cases: list[tuple[list[int], list[int]]] = [
        ([-170, 170, 175, -175, -170], [-170, -190, -185, -175, -170]),
        ([170, -170, -160, -20, 20, 170, -170], [170, 190, 200, 340, 380, 530, 550]),
        ([-10, 10, -10], [-10, 10, -10]),
        ([], []),
    ]
    for bounded, continuous in cases:
        assert accumulate(map(radians, bounded)) == pytest.approx(list(map(radians, continuous)))
