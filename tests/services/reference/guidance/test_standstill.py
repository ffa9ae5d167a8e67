"""A stop ends where the vehicle comes to a standstill."""

from hypothesis import given
from hypothesis import strategies as st

from services.reference.guidance.guards import PATIENCE_S, WORTH, Standstill

MOST = 0.05  # [m]
DT = 0.01  # [s]
error = st.floats(-1.0, 1.0)
rate = st.floats(-0.5, 0.5)
row = st.tuples(error, rate, st.booleans())


def flown(stop: Standstill, rows: list[tuple[float, float, bool]]) -> list[float]:
    return [
        stop.step(error, rate, DT * k, resting=resting, velocity=rate)
        for k, (error, rate, resting) in enumerate(rows)
    ]


@given(st.lists(row, max_size=300))
def test_it_moves_once_for_each_motion_at_rest_and_never_further_than_allowed(
    rows: list[tuple[float, float, bool]],
) -> None:
    moves = flown(Standstill(MOST), rows)
    open_motions = 0
    for by, (off, _, resting) in zip(moves, rows, strict=True):
        open_motions = open_motions if resting else 1
        if by != 0.0:
            assert resting
            assert open_motions == 1
            open_motions = 0
            assert WORTH * MOST <= abs(by) <= MOST
            assert 0.0 <= by / off <= 1.0 + 1e-12


@given(error, st.floats(0.001, 0.5), st.integers(0, 70))
def test_it_waits_for_the_vehicle_to_turn_round(off: float, speed: float, steps: int) -> None:
    stop = Standstill(MOST)
    coasting = [(0.0, speed, False), *[(2 * off, speed, True)] * (steps + 1)]
    assert not any(flown(stop, coasting))
    at = DT * len(coasting)
    expected = max(-MOST, min(MOST, off)) if abs(off) >= WORTH * MOST else 0.0
    assert stop.step(off, -speed, at, resting=True) == expected == stop.moved
    assert stop.step(off, speed, at + DT, resting=True) == 0.0


@given(error, st.floats(0.001, 0.5), st.sampled_from([-1.0, 1.0]))
def test_a_vehicle_that_comes_back_already_is_held_at_once(
    off: float, speed: float, way: float
) -> None:
    stop = Standstill(MOST)
    stop.step(off, speed * way, 0.0, resting=False, velocity=speed * way)
    expected = max(-MOST, min(MOST, off)) if abs(off) >= WORTH * MOST else 0.0
    assert stop.step(off, -speed * way, DT, resting=True) == expected


def test_it_does_not_wait_longer_than_its_patience() -> None:
    rows = [(0.0, 0.02, False), *[(0.03, 0.02, True)] * round(2 * PATIENCE_S / DT)]
    moves = flown(Standstill(MOST), rows)
    (when,) = [k for k, by in enumerate(moves) if by != 0.0]
    assert abs(DT * (when - 1) - PATIENCE_S) < 1.5 * DT
    assert moves[when] == 0.03


@given(st.lists(row, max_size=50), st.lists(st.tuples(error, rate, st.just(True))))
def test_a_motion_to_a_place_that_was_asked_for_is_left_there(
    before: list[tuple[float, float, bool]], after: list[tuple[float, float, bool]]
) -> None:
    stop = Standstill(MOST)
    flown(stop, before)
    stop.cancel()
    assert not any(flown(stop, after))
