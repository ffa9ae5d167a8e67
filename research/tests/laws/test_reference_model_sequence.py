"""Motions in sequence are one motion."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy.api.references import MotionRequest, plan
from tools.generators.route import sequence

many = settings(max_examples=60, deadline=None)
speeds = st.lists(st.one_of(st.just(0.0), st.floats(0.0, 1.0)), min_size=2, max_size=5)


@many
@given(speeds, st.floats(0.0, 1.0))
def test_each_part_starts_where_and_when_the_one_before_arrives(
    speed: list[float], share: float
) -> None:
    parts = [
        plan(MotionRequest(40.0 + k, 1.0, 8.0, 6.0, speed[k], speed[k + 1]))
        for k in range(len(speed) - 1)
    ]
    chain = sequence(parts)
    for k, part in enumerate(parts):
        begin, start = chain.begins[k], chain.starts[k]
        assert start == pytest.approx(sum(40.0 + i for i in range(k)))
        assert chain.at(begin).velocity == pytest.approx(speed[k], abs=1e-12)
        here = part.at(share * part.duration * 0.999)
        assert chain.at(begin + share * part.duration * 0.999)[:3] == pytest.approx(
            (start + here.position, here.velocity, here.acceleration), abs=1e-9
        )
    assert chain.duration == pytest.approx(sum(part.duration for part in parts))
    end = chain.at(chain.duration + 1.0)
    assert end.position == pytest.approx(sum(part.length for part in parts) + speed[-1])
    assert chain.at(-1.0).position == pytest.approx(-speed[0])


def test_a_step_in_velocity_between_two_parts_is_refused() -> None:
    to_half = plan(MotionRequest(40.0, 1.0, 8.0, 6.0, final=0.5))
    from_third = plan(MotionRequest(40.0, 1.0, 8.0, 6.0, initial=0.3))
    with pytest.raises(ValueError, match=r"part 2 starts with velocity 0.3, expected 0.5"):
        sequence([to_half, from_third])


def test_an_empty_sequence_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        sequence([])
