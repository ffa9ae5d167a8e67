"""A picture that waited is never said to be fresh, and what waits for the decoder is bounded."""

from hypothesis import given
from hypothesis import strategies as st

from services.camera.capture_time import (
    AHEAD_NS,
    EARLY_NS,
    LEAK,
    LONGEST_WAIT_NS,
    Backlog,
    CaptureTime,
)

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


@given(st.lists(st.tuples(st.sampled_from("kpt"), st.integers(0, 300 * MS)), max_size=200))
def test_what_waits_is_counted_or_taken_in_order_and_can_be_decoded(
    steps: list[tuple[str, int]],
) -> None:
    """k: a keyframe arrives, p: another picture, t: the decoder takes one."""
    backlog = Backlog[tuple[int, int]]()  # (number, number of its keyframe)
    now, put, keyframe, taken = 0, 0, 0, list[tuple[int, int]]()
    times = dict[int, int]()
    for kind, later in steps:
        now += later
        if kind == "t":
            if (packet := backlog.take()) is not None:
                taken.append(packet)
            continue
        put += 1
        keyframe = put if kind == "k" else keyframe
        times[put] = now
        backlog.put((put, keyframe), now, keyframe=kind == "k")
    left = list(iter(backlog.take, None))
    for number, _ in left:
        assert times[put] - times[number] <= LONGEST_WAIT_NS
    seen = taken + left
    assert len(seen) + backlog.dropped == put
    assert seen == sorted(seen)
    for (before, _), (number, its_key) in zip([(0, 0), *seen], seen, strict=False):
        assert number == before + 1 or number == its_key  # all that it builds on was taken
