"""What the accelerometer may be off by before the gyroscope is doubted."""

from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from services.estimation.attitude.gyroscope import MOST, MOST_TURNING, TURNING, GyroCheck
from services.marine.vehicle import GRAVITY

LEVEL = (1.0, 0.0, 0.0, 0.0)
NO_BIAS = (0.0, 0.0, 0.0)
DT = 0.01  # [s]


def doubted(sideways: float, turn: float, seconds: float = 10.0) -> bool:
    """At a constant specific force [m/s²] sideways and a constant yaw rate [rad/s], attitude level
    by the gyroscope."""
    check = GyroCheck()
    force: Vec3 = (0.0, sideways, -GRAVITY)
    steps = range(round(seconds / DT))
    return any(check.step(LEVEL, force, NO_BIAS, DT, turn)[1] for _ in steps)


def test_a_fast_hull_that_circles_keeps_its_gyroscope() -> None:
    """1.5 m/s at 60 °/s, for as long as it likes; 0.16 rad without a turn is a wrong bias."""
    assert not doubted(1.5 * 1.05, 1.05)
    assert not doubted(-1.5 * 1.05, -1.05)
    assert doubted(1.5 * 1.05, 0.0)


@settings(max_examples=20)
@given(st.floats(-20.0, 20.0))
def test_a_turn_excuses_a_bounded_part_only(turn: float) -> None:
    """As sines: sideways over the whole force."""
    most = MOST + min(MOST_TURNING, TURNING * abs(turn))
    assert not doubted(0.95 * most * GRAVITY, turn, 6.0)
    assert doubted(1.1 * most * GRAVITY, turn, 12.0)
