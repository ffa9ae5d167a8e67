"""A picture that waited is never said to be fresh."""

from hypothesis import given
from hypothesis import strategies as st

from services.camera.capture_time import AHEAD_NS, EARLY_NS, LEAK, CaptureTime

MS, S = 1_000_000, 1_000_000_000
PERIOD = 40 * MS
waits = st.lists(st.integers(0, 5 * S), min_size=1, max_size=60)


@given(waits, st.integers(-(10**15), 10**15), st.integers(0, 300 * MS))
def test_all_that_a_picture_waited_beyond_the_quickest_is_in_its_age(
    waits: list[int], epoch: int, way: int
) -> None:
    """However long it waited, and whatever the source's clock says the time is."""
    capture, arrived = CaptureTime(), 10**16
    began = arrived
    arrivals = list[tuple[int, int]]()
    for number, wait in enumerate(waits):
        made = began + number * PERIOD
        arrived = max(arrived, made + way + wait)
        light = capture.light(made + epoch, None, arrived)
        arrivals.append((made, arrived))
        assert light.at_ns <= arrived
        assert not light.exact
        quickest = min(came - at for at, came in arrivals)
        forgotten = LEAK * (arrived - arrivals[0][1]) + 2.0
        assert made + quickest - 2 <= light.at_ns <= made + quickest + forgotten


@given(st.integers(-10 * S, 10 * S), st.booleans())
def test_a_source_that_says_when_is_believed_where_that_can_be_true(
    before: int, stamped: bool
) -> None:
    arrived = 10**15
    light = CaptureTime().light(123 if stamped else None, arrived - before, arrived)
    possible = -AHEAD_NS <= before < EARLY_NS
    assert light.exact == possible
    assert light.at_ns == (min(arrived, arrived - before) if possible else arrived)


def test_a_clock_that_begins_anew_is_no_picture_of_yesterday() -> None:
    capture = CaptureTime()
    capture.light(10**15, None, 5 * S)
    assert capture.light(0, None, 6 * S).at_ns == 6 * S
