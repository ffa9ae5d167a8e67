"""Stops of a dive made up of straight lines, so that every answer is known beforehand."""

from collections.abc import Callable, Iterator
from math import inf, radians
from typing import Any, Literal

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.link import Clock
from messages.message import Estimate, Message
from messages.pilot import PilotCommand, PilotRequest
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.reference.guidance.axes import CENTRED
from tests.support.said import reference, state, truth
from tools.analysis.dive import RecordedDive, read_dive
from tools.analysis.stops import releases, stops
from tools.recordings.columns import StreamColumns
from tools.recordings.mcap_records import ALWAYS, Span, Wants, always
from tools.recordings.recording import Raw, Recording

START = 7_000_000_000  # [ns] the vehicle's clock at the beginning
RELEASE, REST, END = 4.0, 5.0, 12.0  # [s] stick let go, reference at rest, end of recording
MOVED = 8.0  # [s] when something else moves the drone
SPEED = 0.4  # [m/s] or [rad/s] of the reference until the release
FINAL = SPEED * (RELEASE - 1.0) + SPEED * (REST - RELEASE) / 2  # [m, rad] where it comes to rest
NORTH = 2.0  # [rad] true heading minus control heading
Said = list[tuple[AnyTopic, Message]]


class Memory(Recording):
    """A recording that was never a file."""

    def __init__(self, said: Said) -> None:
        super().__init__([])
        self._said = said

    def raw(self, wants: Wants = always, within: Span = ALWAYS) -> Iterator[Raw]:
        for topic, message in self._said:
            stamp = message.stamp_ns
            if wants(topic.key) and within[0] <= stamp < within[1]:
                yield Raw(topic.key, msgspec.json.encode(message), stamp, stamp)


def ns(t: float) -> int:
    return START + round(t * 1e9)


def reference_at(t: float) -> Motion:
    """At rest until 1 s, at SPEED until the release, evenly slower until at rest."""
    if t < 1.0:
        return Motion(0.0, 0.0, 0.0, 0.0)
    if t < RELEASE:
        return Motion(SPEED * (t - 1.0), SPEED, 0.0, 0.0)
    if t < REST:
        left = REST - t
        slope = SPEED / (REST - RELEASE)
        return Motion(FINAL - slope * left * left / 2, slope * left, -slope, 0.0)
    return Motion(FINAL, 0.0, 0.0, 0.0)


def still(_: float) -> Motion:
    return Motion(3.0, 0.0, 0.0, 0.0)


def moving(
    axis: Literal["heave", "yaw"],
    error: Callable[[float], float],
    sign: float = 1.0,
    armed: Callable[[float], bool] = lambda _: True,
) -> Said:
    """Reference, state and truth, 100 times a second; true motion is reference plus error."""
    said: Said = []
    for n in range(round(END * 100)):
        t = n / 100
        r = reference_at(t)
        motion = Motion(sign * r.position, sign * r.velocity, sign * r.acceleration, 0.0)
        depth, heading = (motion, still(t)) if axis == "heave" else (still(t), motion)
        true = sign * (r.position + error(t))
        true_depth = true if axis == "heave" else 3.0
        true_heading = true if axis == "yaw" else 3.0
        said += [
            (topics.REFERENCE, reference(ns(t), depth=depth, heading=heading, armed=armed(t))),
            (topics.STATE, state(ns(t), depth=depth.position, heading=heading.position)),
            (topics.TRUTH, truth(ns(t), true_depth, true_heading + NORTH)),
        ]
    return said


def sticks(
    axis: str,
    held: Callable[[float], float],
    lost: Callable[[float], bool] = lambda _: False,
    until: float = END,
) -> Said:
    """Stick positions, 50 times a second."""
    return [
        (
            topics.PILOT_COMMAND,
            PilotCommand(
                stamp_ns=ns(n / 50),
                surge=0.0,
                sway=0.0,
                heave=held(n / 50) if axis == "heave" else 0.0,
                yaw=held(n / 50) if axis == "yaw" else 0.0,
                pilot="lost" if lost(n / 50) else "present",
            ),
        )
        for n in range(round(until * 50))
    ]


def held_until_release(t: float) -> float:
    return 1.0 if 0.9 <= t < RELEASE else 0.0


def bump(height: float, until: float) -> Callable[[float], float]:
    """An error of `height` from the release until `until` [s]."""
    return lambda t: height if RELEASE <= t < until else 0.0


def dive_of(said: Said) -> RecordedDive:
    return read_dive(Memory(said))


def test_of_a_real_dive_the_estimate_says_how_it_moved() -> None:
    said = moving("heave", bump(0.1, 6.0)) + sticks("heave", held_until_release)
    real = [row for row in said if row[0] is not topics.TRUTH]
    (stop,) = stops(dive_of(real))
    assert (stop.axis, stop.by) == ("heave", "estimate")
    assert stop.overshoot == pytest.approx(0.0, abs=1e-9)  # the estimate followed
    (true,) = stops(dive_of(said))
    assert true.by is msgspec.UNSET
    assert true.overshoot == pytest.approx(0.1, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["heave", "yaw"])
@given(
    height=st.floats(min_value=-0.5, max_value=0.5),
    sign=st.sampled_from([-1.0, 1.0]),
    until=st.sampled_from([5.5, 8.0]),
)
@settings(max_examples=10, deadline=None)
def test_overshoot_and_settling_are_those_of_the_true_motion_in_the_direction_of_travel(
    axis: Literal["heave", "yaw"], height: float, sign: float, until: float
):
    said = moving(axis, bump(height, until), sign) + sticks(
        axis, lambda t: sign * held_until_release(t)
    )
    (stop,) = stops(dive_of(said))
    assert stop.axis == axis
    assert stop.t == pytest.approx(RELEASE)
    assert stop.overshoot == pytest.approx(max(0.0, height), abs=1e-6)
    near = 0.05 if axis == "heave" else radians(1.0)
    assert stop.settle_s == pytest.approx(settled_after(bump(height, until), near))


def settled_after(error: Callable[[float], float], near: float) -> float:
    """[s] from the release to the first sample after the last one that was not near."""
    samples = [n / 100 for n in range(round(RELEASE * 100), round(END * 100))]
    far = [t for t in samples if abs(reference_at(t).position + error(t) - FINAL) > near]
    return far[-1] + 0.01 - RELEASE


def test_a_vehicle_that_never_comes_near_has_not_settled():
    said = moving("heave", bump(-0.2, END)) + sticks("heave", held_until_release)
    (stop,) = stops(dive_of(said))
    assert stop.settle_s is None
    assert stop.overshoot == 0.0


def test_a_stop_ends_with_the_next_deflection():
    def again(t: float) -> float:
        return 1.0 if t >= 8.0 else held_until_release(t)

    said = moving("heave", lambda t: 0.3 if t >= 8.0 else 0.0) + sticks("heave", again)
    (stop,) = stops(dive_of(said))
    assert stop.overshoot == pytest.approx(0.0, abs=1e-6)


def test_a_stop_cut_short_before_the_reference_rests_does_not_count():
    def again(t: float) -> float:
        return 1.0 if t >= REST - 0.1 else held_until_release(t)

    assert stops(dive_of(moving("heave", lambda _: 0.0) + sticks("heave", again))) == []


@pytest.mark.slow
def test_a_stop_broken_off_by_disarming_does_not_count_nor_one_before_arming():
    let_go = sticks("heave", held_until_release)
    broken_off = moving("heave", lambda _: 0.0, armed=lambda t: t < REST - 0.1)
    too_late = moving("heave", lambda _: 0.0, armed=lambda t: t > RELEASE + 0.1)
    assert stops(dive_of(broken_off + let_go)) == []
    assert stops(dive_of(too_late + let_go)) == []


@pytest.mark.slow
def test_time_counts_from_arming():
    said = moving("heave", lambda _: 0.0, armed=lambda t: t >= 0.5)
    (stop,) = stops(dive_of(said + sticks("heave", held_until_release)))
    assert stop.t == pytest.approx(RELEASE - 0.5)


def held(t: float) -> float:
    return 1.0 if t >= 0.9 else 0.0


def request(t: float, kind: Literal["stop", "arm"]) -> Said:
    return [(topics.PILOT_REQUEST, PilotRequest(stamp_ns=ns(t), id="1", kind=kind))]


def status(t: float, failsafe: Literal["none", "pilot_lost"]) -> Said:
    message = VehicleStatus(stamp_ns=ns(t), activity="piloted", armed=True, failsafe=failsafe)
    return [(topics.STATUS, message)]


@pytest.mark.parametrize(
    "said",
    [
        sticks("heave", held, lost=lambda t: t >= RELEASE),
        sticks("heave", held) + request(RELEASE, "stop"),
        sticks("heave", held, until=RELEASE) + status(0.0, "none") + status(RELEASE, "pilot_lost"),
    ],
    ids=["pilot lost", "stop asked for", "link cut"],
)
def test_a_stop_is_a_stop_whoever_let_go(said: Said):
    (stop,) = stops(dive_of(moving("heave", bump(0.1, 6.0)) + said))
    assert stop.t == pytest.approx(RELEASE)
    assert stop.overshoot == pytest.approx(0.1)
    assert stop.settle_s == pytest.approx(6.0 - RELEASE, abs=0.011)


def test_after_a_stop_request_only_centred_sticks_count_as_deflected_again():
    def twitching(t: float) -> float:  # never centred: the drone stays stopped
        return 1.0 if t < 6.0 else 0.5

    said = moving("heave", bump(0.1, 9.0)) + sticks("heave", twitching)
    (stop,) = stops(dive_of(said + request(RELEASE, "stop")))
    assert stop.settle_s == pytest.approx(9.0 - RELEASE, abs=0.011)


@pytest.mark.slow
@given(ahead=st.integers(-START, 10**16))
@settings(max_examples=10, deadline=None)
def test_stops_do_not_depend_on_how_far_the_clock_of_the_topside_is_ahead(ahead: int):
    said = moving("heave", bump(0.1, 6.0))
    hands = sticks("heave", held) + request(RELEASE, "stop")
    clock = Clock(
        stamp_ns=0, offset_ns=-ahead, bound_ns=0, drift_ppm=0.0,
        rtt_ms=1.0, rtt_min_ms=1.0, answered_ms=0.0,
    )  # fmt: skip
    there = [
        (topic, msgspec.structs.replace(message, stamp_ns=message.stamp_ns + ahead))
        for topic, message in hands
    ]
    apart = read_dive(Memory([*said, (topics.CLOCK, clock), *there]), apart=True)
    assert stops(apart) == stops(dive_of(said + hands)) != []


def test_sticks_of_a_topside_whose_clock_is_not_known_stopped_nothing():
    said = moving("heave", bump(0.1, 6.0)) + sticks("heave", held_until_release)
    assert stops(read_dive(Memory(said), apart=True)) == []


def rising(t: float) -> float:
    """A reference and a drone that something else moves from 8 s on, far past the stop."""
    return 0.0 if t < MOVED else -2.0 * (t - MOVED)


def moved_later() -> Said:
    """As `moving`, and both the reference and the truth go elsewhere from MOVED on."""
    said: Said = []
    for topic, message in moving("heave", bump(0.1, 6.0)):
        t = (message.stamp_ns - START) / 1e9
        if isinstance(message, Reference) and t >= MOVED:
            position = FINAL + rising(t) if t < MOVED + 2.0 else FINAL + rising(MOVED + 2.0)
            message = msgspec.structs.replace(message, depth=Motion(position, 0.0, 0.0, 0.0))
        said.append((topic, message))
    return said


def flown(t: float, **fields: Any) -> Said:
    known: dict[str, Any] = {"activity": "piloted", "armed": True} | fields
    return [(topics.STATUS, VehicleStatus(stamp_ns=ns(t), **known))]


def with_state(said: Said, **fields: Any) -> Said:
    """The states from MOVED on, with other fields."""
    return [
        (topic, msgspec.structs.replace(message, **fields))
        if isinstance(message, VehicleState) and message.stamp_ns >= ns(MOVED)
        else (topic, message)
        for topic, message in said
    ]


OTHERS = {
    "ascent": flown(MOVED, failsafe="leak", reaction="ascend"),
    "surface": flown(MOVED, failsafe="battery_critical", reaction="surface"),
    "imu lost": flown(MOVED, failsafe="imu_lost", reaction="stop"),
    "goto": flown(MOVED, activity="goto"),
    "follow": flown(MOVED, activity="follow"),
    "flight mode": flown(0.0) + flown(MOVED, flight_mode="manual"),
}


@pytest.mark.slow
@pytest.mark.parametrize("said", OTHERS.values(), ids=OTHERS)
def test_a_stop_ends_where_something_else_moves_the_drone_and_counts_until_then(said: Said):
    (stop,) = stops(dive_of(moved_later() + sticks("heave", held_until_release) + said))
    assert stop.overshoot == pytest.approx(0.1)
    assert stop.settle_s == pytest.approx(6.0 - RELEASE, abs=0.011)


def test_no_depth_is_stopped_at_while_a_height_is_held():
    said = flown(0.0, flight_mode="altitude_hold") + flown(MOVED, flight_mode="altitude_hold")
    said += flown(RELEASE + 0.1, flight_mode="altitude_hold")
    assert stops(dive_of(moved_later() + sticks("heave", held_until_release) + said)) == []


@pytest.mark.parametrize(
    "fields",
    [{"depth_moved": 1.0}, {"depth": Estimate(FINAL, 0.0, valid=False)}],
    ids=["pressure jump", "depth not known"],
)
def test_a_stop_ends_where_the_estimate_jumps_or_is_not_valid(fields: dict[str, Any]):
    said = with_state(moved_later(), **fields)
    (stop,) = stops(dive_of(said + sticks("heave", held_until_release)))
    assert stop.overshoot == pytest.approx(0.1)


def test_a_failsafe_that_only_holds_goes_on_with_the_same_stop():
    lost = sticks("heave", held, lost=lambda t: t >= RELEASE)
    holds = flown(RELEASE + 0.3, failsafe="pilot_lost", reaction="stop")
    (stop,) = stops(dive_of(moving("heave", bump(0.1, 6.0)) + lost + holds))
    assert stop.overshoot == pytest.approx(0.1)


def test_only_the_sticks_of_the_pilot_in_control_count():
    said = [
        (topic, msgspec.structs.replace(message, epoch=2) if topic is topics.REFERENCE else message)
        for topic, message in moving("heave", bump(0.1, 6.0))
    ]
    holder = [
        (topic, msgspec.structs.replace(message, epoch=2))
        for topic, message in sticks("heave", held_until_release)
    ]
    other = sticks("heave", lambda _: 0.0)  # of epoch 0, between those of the other
    (stop,) = stops(dive_of(said + holder + other))
    assert stop.t == pytest.approx(RELEASE)


def test_without_truth_and_estimate_there_is_nothing_to_measure():
    unknown = (topics.TRUTH, topics.STATE)
    said = [s for s in moving("heave", lambda _: 0.0) if s[0] not in unknown]
    assert stops(dive_of(said + sticks("heave", held_until_release))) == []
    assert stops(dive_of([])) == []


STAMPS = st.integers(0, 12)
COMMANDS = st.lists(
    st.tuples(
        STAMPS, st.sampled_from((-0.5, 0.0, 0.5)), st.sampled_from((0.0, 0.01, 0.5)), st.booleans()
    ),
    max_size=25,
)
REQUESTS = st.lists(st.tuples(STAMPS, st.booleans()), max_size=4)
STATUSES = st.lists(st.tuples(STAMPS, st.integers(0, 1)), max_size=6)
Rows = list[tuple[Any, ...]]


@given(COMMANDS, REQUESTS, STATUSES)
def test_releases_are_those_that_one_event_after_the_other_tells(
    commands: Rows, requests: Rows, statuses: Rows
) -> None:
    def columns(names: str, rows: Rows, *words: str) -> StreamColumns:
        whole = np.array(rows, dtype=np.float64).reshape(-1, len(names.split()))
        return StreamColumns(dict(zip(names.split(), whole.T, strict=True)), words)

    heard = [(at, stick, other, 0.0, 0.0, float(lost), 0.0) for at, stick, other, lost in commands]
    names = "stamp_ns heave surge sway yaw pilot epoch"
    streams = {
        topics.PILOT_COMMAND.key: columns(names, heard, "present", "lost"),
        topics.PILOT_REQUEST.key: columns("stamp_ns kind", requests, "arm", "stop"),
        topics.STATUS.key: columns("stamp_ns failsafe", statuses, "none", "leak"),
        topics.REFERENCE.key: columns("valid_ns epoch", []),
    }
    found = releases(RecordedDive({}, {}, streams), "heave")
    assert [(each.begin, each.end, each.sign) for each in found] == [
        *one_by_one(commands, requests, statuses)
    ]


def one_by_one(
    commands: Rows, requests: Rows, statuses: Rows
) -> Iterator[tuple[float, float, float]]:
    """(begin, end, sign) of each release."""
    events = [
        (at, kind, value)
        for at, stick, other, lost in commands
        for kind, value in (
            ("lost", lost),
            ("centred", max(abs(stick), other) < CENTRED),
            ("stick", np.sign(stick)),
        )
    ]
    events += [(at, "stop", stop) for at, stop in requests]
    events += [(at, "failsafe", acts) for at, acts in statuses]
    now = dict.fromkeys(["stick", "lost", "failsafe", "stop"], 0.0)
    before, since, sign = 0.0, None, 0.0
    for at, kind, value in sorted(events, key=lambda event: event[0]):
        if kind == "centred":
            now["stop"] *= not (value and not now["lost"])
        else:
            now[kind] = max(value, now["stop"]) if kind == "stop" else value
        wanted = 0.0 if now["lost"] or now["failsafe"] or now["stop"] else now["stick"]
        if before and not wanted:
            since, sign = at, before
        elif wanted and since is not None:
            yield since, at, sign
            since = None
        before = wanted
    if since is not None:
        yield since, inf, sign
