from collections.abc import Callable
from itertools import pairwise
from math import degrees, dist, isnan, pi, radians

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import events, topics
from messages.link import LinkStatus
from messages.message import Estimate, Message
from messages.pilot import PilotRequest
from messages.state import Prediction, VehicleState
from messages.topic import AnyTopic
from messages.vehicle import Actuation, Truth
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.visualizer.batch import Batch
from services.visualizer.core import BY_ARRIVAL, OLDEST_NS, SPACING_NS, Collector
from services.visualizer.curves import curves
from services.visualizer.scene import STEP_M, TRAIL_POINTS
from tests.support.messages import example

Sample = Callable[[str, int], Message]
SECOND = 1_000_000_000
DAY = 86_400 * SECOND
VEHICLE = Stack().section("vehicle", Vehicle)


def key_of(topic: AnyTopic) -> str:
    return topic.key.replace("*", "control")


def truth(time: int, *, north: float = 0.0, depth: float = 1.0, floor: bool = False) -> Truth:
    return example(Truth, time, position=(north, 0.0, depth), heading=1.0, on_floor=floor)


def shown(batch: Batch) -> list[object]:
    pages = [note for note in batch.notes if note.kind == "document"]
    return [*batch.columns, *batch.video, *[note for note in batch.notes if note not in pages]]


def test_every_row_of_the_table_leads_to_something_shown(sample: Sample) -> None:
    for topic in topics.ALL:
        collector = Collector(VEHICLE)
        assert collector.hear(topic, key_of(topic), sample(topic.key, SECOND), SECOND) is None
        assert shown(collector.drain(SECOND)), topic.key


def test_two_requests_that_wait_at_the_same_time_are_shown_once_each() -> None:
    collector = Collector(VEHICLE)
    for k in range(1, 11):  # both are repeated until they are answered
        for kind in ("arm", "home"):
            ask = PilotRequest(stamp_ns=k * SECOND, id=kind, kind=kind)
            collector.hear(topics.PILOT_REQUEST, topics.PILOT_REQUEST.key, ask, k * SECOND)
    notes = collector.drain(11 * SECOND).notes
    assert sum("pilot asks" in note.text for note in notes) == 2


@given(stamps=st.lists(st.integers(0, 10**9), min_size=1, max_size=40, unique=True))
@settings(max_examples=50, deadline=None)
def test_points_are_as_dense_as_a_screen_shows_and_columns_are_rectangular(
    stamps: list[int],
) -> None:
    """Every sample is a point, or soon after one; points are never nearer than that."""
    collector = Collector(VEHICLE, start=0)
    for stamp in sorted(stamps):
        collector.hear(topics.TRUTH, "simulator/truth", truth(stamp), stamp)
    batch = collector.drain(max(stamps))
    assert batch.columns
    for columns in batch.columns:
        assert len(columns.times) == len(columns.rows)
        assert len({len(row) for row in columns.rows}) == 1
        assert all(after - before >= SPACING_NS for before, after in pairwise(columns.times))
        for stamp in stamps:
            assert any(0 <= stamp - time < SPACING_NS for time in columns.times)
    assert not shown(collector.drain(max(stamps)))


def test_a_sender_whose_clock_starts_anew_is_drawn_at_once() -> None:
    collector = Collector(VEHICLE, start=0)
    for stamp in (50 * SECOND, 10 * SECOND):
        collector.hear(topics.TRUTH, "simulator/truth", truth(stamp), 50 * SECOND)
    assert {len(columns.rows) for columns in collector.drain(50 * SECOND).columns} == {2}


def test_names_colours_and_numbers_of_a_curve_agree(sample: Sample) -> None:
    paths = [curve.path for curve in curves(VEHICLE)]
    assert len(paths) == len(set(paths))
    for curve in curves(VEHICLE):
        row = curve.read(sample(curve.topic.key, SECOND))
        assert len(curve.look.names) == len(curve.look.colours)
        if row is not None and curve.look.names:
            assert len(row) == len(curve.look.names), curve.path


def test_angles_are_shown_in_degrees_and_latencies_in_milliseconds(sample: Sample) -> None:
    collector = Collector(VEHICLE)
    collector.hear(topics.TRUTH, "simulator/truth", truth(0), 0)
    collector.hear(topics.ACTUATION, "vehicle/actuation", sample("vehicle/actuation", 0), 0)
    values = {c.path: c.rows[0] for c in collector.drain(0).columns}
    assert values["heading/truth"] == pytest.approx([degrees(1.0)])
    assert values["latency/sensor"] == pytest.approx([2.0])
    assert values["latency/stick"] == pytest.approx([40.0])


@given(st.floats(-50.0, 50.0), st.floats(-3.14, 3.14))
def test_both_headings_are_counted_alike(heading: float, off: float) -> None:
    """[rad] `heading` goes on beyond a full turn; the compass's does not."""
    compass = (heading + off + pi) % (2.0 * pi) - pi
    state = example(
        VehicleState, heading=Estimate(heading, 0.1), heading_navigation=Estimate(compass, 0.1)
    )
    (curve,) = (curve for curve in curves(VEHICLE) if curve.path == "compass")
    assert curve.read(state) == pytest.approx((degrees(heading + off),))


def test_a_state_is_noted_only_when_it_changes(sample: Sample) -> None:
    collector = Collector(VEHICLE)
    status = sample("vehicle/status", SECOND)
    off = msgspec.structs.replace(status, armed=False)  # type: ignore[call-arg]
    for time, message in enumerate([status, status, off, off, status]):
        again = msgspec.structs.replace(message, stamp_ns=time)
        collector.hear(topics.STATUS, "vehicle/status", again, time)
    armed = [n for n in collector.drain(SECOND).notes if n.path == "state/armed"]
    assert [n.text for n in armed] == ["armed", "disarmed", "armed"]
    assert [n.time for n in armed] == [0, 2, 4]


def test_a_disarm_by_control_is_seen_while_the_reference_that_says_armed_hangs(
    sample: Sample,
) -> None:
    collector = Collector(VEHICLE)
    collector.hear(topics.STATUS, "vehicle/status", sample("vehicle/status", 0), 0)
    collector.drain(0)
    for time, armed in [(SECOND, True), (2 * SECOND, False)]:
        command = sample("control/thrusters", time)
        command = msgspec.structs.replace(command, armed=armed)  # type: ignore[call-arg]
        collector.hear(topics.THRUSTERS, "control/thrusters", command, time)
        lanes = [n.text for n in collector.drain(time).notes if n.path == "state/armed"]
        assert lanes == ([] if armed else ["disarmed"])


@given(norths=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60))
@settings(max_examples=50, deadline=None)
def test_the_path_flown_is_thinned_and_never_interrupted(norths: list[float]) -> None:
    collector, drawn = Collector(VEHICLE), list[list[tuple[float, float, float]]]()
    for time, north in enumerate(norths):
        collector.hear(topics.TRUTH, "simulator/truth", truth(time, north=north), time)
        if time % 7 == 0:
            drawn.append(collector.drain(time).trail)
    drawn.append(collector.drain(len(norths)).trail)
    strips = [strip for strip in drawn if strip]
    for strip in strips:
        assert all(dist(a, b) >= STEP_M for a, b in pairwise(strip))
    for before, after in pairwise(strips):
        assert after[0] == before[-1]


def test_an_undrawn_path_stays_bounded() -> None:
    collector = Collector(VEHICLE)
    for step in range(TRAIL_POINTS + 100):
        collector.hear(topics.TRUTH, "simulator/truth", truth(step, north=float(step)), step)
    assert len(collector.drain(0).trail) == TRAIL_POINTS


def test_the_floor_is_drawn_when_it_is_found_and_again_only_when_deeper() -> None:
    collector, half = Collector(VEHICLE), VEHICLE.size[2] / 2
    found: list[float | None] = []
    for time, depth in enumerate([2.0, 2.0, 3.0, 2.5]):
        message = truth(time, depth=depth, floor=True)
        collector.hear(topics.TRUTH, "simulator/truth", message, time)
        floor = collector.drain(time).floor
        found.append(None if floor is None else floor[2])
    assert found == [2.0 + half, None, 3.0 + half, None]


def test_the_scene_moves_only_with_the_vehicle(sample: Sample) -> None:
    collector = Collector(VEHICLE)
    assert collector.frame() is None
    collector.hear(topics.STATE, "state", sample("state", 0), 0)
    assert (first := collector.frame()) is not None
    assert first.position == (0.0, 0.0, 1.0)  # nobody knows north and east
    assert collector.frame() is None
    collector.hear(topics.TRUTH, "simulator/truth", truth(1, north=4.0), 1)
    assert (second := collector.frame()) is not None
    assert second.position == (4.0, 0.0, 1.0)


def test_nonsense_that_is_well_formed_is_refused_with_a_reason(sample: Sample) -> None:
    collector = Collector(VEHICLE)
    key = topics.ACTUATION.key
    short = msgspec.structs.replace(sample(key, 0), thrust=(1.0,))  # type: ignore[call-arg]
    assert collector.hear(topics.ACTUATION, key, short, 0) is events.WRONG_LENGTH
    ancient = msgspec.structs.replace(truth(0), stamp_ns=-(2**63))
    assert collector.hear(topics.TRUTH, "simulator/truth", ancient, 0) is events.TOO_OLD
    assert collector.hear(topics.TRUTH, "simulator/truth", truth(-OLDEST_NS), 0) is None
    assert isinstance(short, Actuation)


def test_the_status_page_says_what_a_pilot_asks_first(sample: Sample) -> None:
    collector = Collector(VEHICLE)
    for topic in topics.ALL:
        collector.hear(topic, key_of(topic), sample(topic.key, 0), 0)
    pages = {n.path: n.text for n in collector.drain(0).notes if n.kind == "document"}
    for word in ("piloted", "ARMED", "1.00 m", "57.3°", "16.0 V", "round trip 2 ms", "nobody has"):
        assert word in pages["status"]
    assert not [n for n in collector.drain(0).notes if n.kind == "document"]


@given(turns=st.integers(-5, 5), degree=st.integers(0, 359))
@settings(max_examples=30, deadline=None)
def test_the_status_page_says_headings_as_a_compass_does(turns: int, degree: int) -> None:
    heading = Estimate(radians(360 * turns + degree), 0.1)
    state = example(VehicleState, phase="running", heading=heading)
    collector = Collector(VEHICLE)
    collector.hear(topics.STATE, "state", state, 0)
    [page] = [n.text for n in collector.drain(0).notes if n.path == "status"]
    assert f"   {degree}.0°" in page


@pytest.mark.parametrize("ahead", [-DAY, DAY])
def test_what_is_of_either_clock_is_shown_when_it_came(ahead: int, sample: Sample) -> None:
    """As said on a machine whose clock is elsewhere; the gates have translated the rest."""
    either = {topics.HEALTH, topics.LOG, topics.CLOCK_PONG, topics.PILOT_ANSWER}
    assert {topic.key for topic in either} <= BY_ARRIVAL
    for topic in topics.ALL:
        if topic.key in BY_ARRIVAL:
            collector = Collector(VEHICLE, start=0)
            message = sample(topic.key, SECOND + ahead)
            assert collector.hear(topic, key_of(topic), message, SECOND) is None
            batch = collector.drain(SECOND)
            assert {time for columns in batch.columns for time in columns.times} <= {SECOND}
            assert {note.time for note in batch.notes} == {SECOND}, topic.key


@given(known=st.lists(st.booleans(), max_size=30), cuts=st.sets(st.integers(0, 30)))
@settings(max_examples=80, deadline=None)
def test_what_is_not_known_breaks_the_line_once(known: list[bool], cuts: set[int]) -> None:
    """Wherever the batches are cut: every known value, and one NaN where each gap begins."""
    collector = Collector(VEHICLE, start=0)
    drawn: list[tuple[int, float]] = []

    def draw() -> None:
        for columns in collector.drain(0).columns:
            if columns.path == "link_p99/rtt":
                values = [row[0] for row in columns.rows]
                drawn.extend(zip(columns.times, values, strict=True))

    for time, is_known in enumerate(known):
        rtt_ms = 80.0 if is_known else None
        collector.hear(topics.LINK, "link", example(LinkStatus, time, rtt_ms=rtt_ms), time)
        if time in cuts:
            draw()
    draw()
    gaps = [time for time, value in drawn if isnan(value)]
    assert [time for time, value in drawn if not isnan(value)] == [
        time for time, is_known in enumerate(known) if is_known
    ]
    assert gaps == [t for t in range(1, len(known)) if known[t - 1] and not known[t]]


def prediction(time: int, forward: float = 0.0) -> Prediction:
    """North and east are the estimate's, which may be away from the truth that is drawn."""
    return example(
        Prediction, time, state_ns=time, heading=0.0, forward=forward, starboard=0.0,
        north=7.0, east=7.0,
    )  # fmt: skip


@given(north=st.floats(-1e3, 1e3), forward=st.floats(-10.0, 10.0))
@settings(max_examples=30, deadline=None)
def test_the_predicted_ghost_is_as_far_ahead_as_the_vehicle_has_moved_since(
    north: float, forward: float
) -> None:
    collector = Collector(VEHICLE)
    collector.hear(topics.TRUTH, "simulator/truth", truth(0, north=north), 0)
    collector.hear(topics.PREDICTION, "prediction", prediction(0, forward=forward), 0)
    frame = collector.frame()
    assert frame is not None
    assert frame.now == pytest.approx((north + forward, 0.0, 1.0))
