"""The two sets of gains: which one is in force, and no bump between them."""

from hypothesis import given
from hypothesis import strategies as st

from services.control.axis.axis import FeedbackGains, GainBlend, StaticGains

MOVING = FeedbackGains(50.0, 40.0, 0.0)
RESTING = StaticGains(kp=20.0, kd=90.0, zone=0.02, leave=0.1, blend=0.5)
AT_REST = FeedbackGains(RESTING.kp, RESTING.kd, RESTING.zone)
DT = 0.01
error = st.floats(-0.3, 0.3)


def settled(blend: GainBlend, *, moves: bool, error: float) -> FeedbackGains:
    """The gains once the blend has had its time, and one step to show it."""
    for _ in range(round(RESTING.blend / DT) + 1):
        blend.step(moves, error, DT)
    return blend.step(moves, error, DT)


@given(st.booleans(), error)
def test_without_gains_of_rest_those_of_motion_always_hold(moves: bool, error: float) -> None:
    assert GainBlend(MOVING, None).step(moves, error, DT) == MOVING


@given(error)
def test_it_begins_at_rest_and_motion_brings_the_moving_gains_in_the_time_of_the_blend(
    error: float,
) -> None:
    blend = GainBlend(MOVING, RESTING)
    assert blend.step(True, error, DT) == AT_REST
    last = round(RESTING.blend / DT)
    shares = [(blend.step(True, error, DT).kp - 20.0) / 30.0 for _ in range(last)]
    assert shares == sorted(shares)
    assert 0.45 < shares[last // 2 - 1] < 0.55
    assert shares[-2] < 1.0
    assert blend.step(True, error, DT) == MOVING


@given(error, error)
def test_a_large_error_calls_for_the_moving_gains_until_it_is_half_as_large(
    first: float, second: float
) -> None:
    blend = GainBlend(MOVING, RESTING)
    stirred = abs(first) > RESTING.leave
    assert settled(blend, moves=False, error=first) == (MOVING if stirred else AT_REST)
    stirred = abs(second) > RESTING.leave or (stirred and abs(second) > RESTING.leave / 2)
    assert settled(blend, moves=False, error=second) == (MOVING if stirred else AT_REST)


@given(st.lists(st.tuples(st.booleans(), error), min_size=1, max_size=100))
def test_from_one_step_to_the_next_the_gains_change_little_and_stay_between_the_two(
    steps: list[tuple[bool, float]],
) -> None:
    blend, before = GainBlend(MOVING, RESTING), 20.0
    most = 1.5 * DT / RESTING.blend * 30.0  # the curve is at most half as steep again as a line
    for moves, error in steps:
        now = blend.step(moves, error, DT)
        assert abs(now.kp - before) <= most * (1 + 1e-9)
        assert 20.0 <= now.kp <= 50.0
        assert 40.0 <= now.kd <= 90.0
        assert 0.0 <= now.zone <= 0.02
        before = now.kp


@given(st.floats(0.0, 0.1), error, st.floats(0.0, 100.0))
def test_the_spring_pulls_from_the_edge_of_the_zone_on(
    zone: float, error: float, kp: float
) -> None:
    force = FeedbackGains(kp, 0.0, zone).spring(error)
    assert abs(force) - kp * max(0.0, abs(error) - zone) <= 1e-9
    assert abs(force) >= kp * max(0.0, abs(error) - zone) - 1e-9
    assert force * error >= 0.0
