"""The reference on a busy computer: it is of the sensors' time, not of when it is handled."""

from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import PilotCommand, PilotRequest
from messages.reference import Motion
from messages.state import VehicleState
from services.reference.core import ReferenceGenerator, Settings
from tests.support.said import state

MS, PERIOD_MS = 1_000_000, 10  # [ns], [ms]
SILENT_AFTER = 10  # [periods] as the service waits
# How many states come in a row, and for how many periods none does, after that.
stretches = st.lists(st.tuples(st.integers(1, 60), st.integers(0, 30)), min_size=1, max_size=6)


def under_way(sensor_ns: int) -> VehicleState:
    """A vehicle that moves as it is asked to."""
    t = sensor_ns / 1e9
    return state(sensor_ns, depth=2.0 + 0.4 * t, heading=0.5 * t)


def flown(moves: list[tuple[int, int]], latency_ms: int) -> list[tuple[Motion, Motion]]:
    """Depth and heading of every reference, sticks away from the centre all the time."""
    generator, k = ReferenceGenerator(Settings(), Outbox()), 100
    said: list[tuple[Motion, Motion]] = []

    def step(*, heard: bool) -> None:
        nonlocal k
        k += 1
        now = (k * PERIOD_MS + latency_ms) * MS
        sticks = PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=1.0, yaw=1.0)
        out = generator.step(under_way(k * PERIOD_MS * MS) if heard else None, sticks, now)
        assert out is not None
        said.append((out.depth, out.heading))

    step(heard=True)
    present = PilotCommand(stamp_ns=0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
    answer = generator.answer(PilotRequest(stamp_ns=0, id="1", kind="arm"), present, 0)
    assert answer.accepted, answer.reason
    for states, silence in moves:
        for _ in range(states):
            step(heard=True)
        if silence > SILENT_AFTER:
            k += SILENT_AFTER
            for _ in range(silence - SILENT_AFTER):
                step(heard=False)
    return said


@settings(max_examples=40, deadline=None)
@given(stretches, st.integers(1, 80))
def test_the_same_samples_handled_later_give_the_same_reference(
    moves: list[tuple[int, int]], latency_ms: int
) -> None:
    assert flown(moves, latency_ms) == flown(moves, 0)
