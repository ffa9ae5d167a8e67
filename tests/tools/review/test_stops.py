"""A stop's way beyond its release, and back, is the one that was put in."""

from collections.abc import Sequence
from math import nan, pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.message import Estimate
from messages.pilot import FlightMode
from messages.state import VehicleState
from services.reference.settings import Settings
from services.runtime.config.stack import Stack
from tools.analysis.dive import STICKS, RecordedDive
from tools.analysis.stops import counting
from tools.log.cut import ArmedSpan
from tools.recordings.columns import Gathering, StreamColumns
from tools.review.estimation import beside
from tools.review.recorded import STATE, SensorColumns, Track
from tools.review.recorded import track as track_of
from tools.review.section import MOST_POINTS, thinned
from tools.review.stops import SHORTEST_S, reviewed_stops

LET_GO, SPEED, TAU = 5.0, 0.4, 0.6  # [s], [m/s], [s]
T = np.arange(0.0, 20.0, 0.01)
STATUS = ("stamp_ns", "failsafe", "activity", "flight_mode")


def dive(
    stick: str, *, rest: float = 0.0, full: float = 1.0, armed: list[ArmedSpan] | None = None
) -> RecordedDive:
    """One stick, deflected for five seconds, then where the pad has its centre."""
    t = np.arange(0.0, 20.0, 0.02)
    columns: dict[str, np.ndarray] = {
        name: np.zeros_like(t) for name in (*STICKS, "pilot", "epoch")
    }
    columns[stick] = np.where(t < LET_GO, full, rest)
    streams = {
        topics.PILOT_COMMAND.key: StreamColumns({"stamp_ns": t * 1e9, **columns}, ["present"]),
        topics.PILOT_REQUEST.key: stream("stamp_ns", "kind"),
        topics.STATUS.key: stream(*STATUS),
        topics.REFERENCE.key: stream("valid_ns", "epoch"),
        topics.TRUTH.key: stream("stamp_ns", "heave", "yaw"),
    }
    return counting(RecordedDive({}, {}, streams), armed)


def stream(*names: str, rows: Sequence[Sequence[float]] = (), words: str = "") -> StreamColumns:
    whole = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    return StreamColumns(dict(zip(names, whole.T, strict=True)), words.split())


def track(**columns: np.ndarray) -> Track:
    nothing = np.full_like(T, np.nan)
    return Track(T, *(columns.get(name, nothing) for name in Track._fields[1:]))


def settings(folder: Path) -> Settings:
    return Stack(vehicle="pioneer", out=str(folder)).section("reference", Settings)


def sinking(bounce: float) -> Track:
    """Coasts after the release with a time constant of 0.6 s, and comes back by `bounce` [m]."""
    since = np.maximum(0.0, T - LET_GO)
    back = np.clip((since - 4.0) / 2.0, 0.0, 1.0)
    depth = SPEED * np.minimum(T, LET_GO) + SPEED * TAU * (1.0 - np.exp(-since / TAU))
    depth -= bounce * 0.5 * (1.0 - np.cos(pi * back))
    rate = np.gradient(depth, T)
    return track(depth=depth, depth_rate=rate, depth_acceleration=np.gradient(rate, T))


@pytest.mark.parametrize("bounce", [0.0, 0.05])
@pytest.mark.parametrize("centre", [0.0, 0.02])  # a pad is hardly ever quite centred
def test_a_stop_is_measured(bounce: float, centre: float, tmp_path: Path) -> None:
    found = reviewed_stops(
        dive("heave", rest=centre), sinking(bounce), None, settings(tmp_path), None
    )
    (stop,) = found.stops
    assert found.missing == []
    assert stop.axis == "heave"
    assert stop.t == pytest.approx(LET_GO, abs=0.03)
    assert stop.speed == pytest.approx(SPEED, rel=0.05)
    assert stop.ran_on == pytest.approx(SPEED * TAU, rel=0.05)
    assert stop.bounced_back == pytest.approx(bounce, abs=1e-3)
    assert stop.seconds is not None
    # 0.4 m/s decays to 0.02 m/s in τ ln 20.
    assert stop.seconds == pytest.approx(TAU * np.log(20.0), abs=0.05)
    assert stop.lindy_ran_on is not None
    assert 0.0 < stop.lindy_ran_on < SPEED * 2.0
    assert stop.jerk is not None


def test_where_the_truth_was_recorded_a_stop_is_measured_by_it(tmp_path: Path) -> None:
    flown, true = dive("heave"), sinking(0.0)
    rows = [(1e9 * t, depth, 0.0) for t, depth in zip(true.t, true.depth, strict=True)]
    flown.streams[topics.TRUTH.key] = stream("stamp_ns", "heave", "yaw", rows=rows)
    found = reviewed_stops(flown, sinking(0.05), None, settings(tmp_path), None)
    (stop,) = found.stops
    assert (stop.by, stop.bounced_back) == ("truth", pytest.approx(0.0, abs=1e-3))
    assert stop.ran_on == pytest.approx(SPEED * TAU, rel=0.05)
    estimated = reviewed_stops(dive("heave"), sinking(0.05), None, settings(tmp_path), None)
    assert [stop.by for stop in estimated.stops] == ["estimate"]


def test_a_stop_ends_where_the_drone_goes_on_by_itself(tmp_path: Path) -> None:
    """What a manoeuvre does after it is no coming back: the drone was sent there."""
    flown = dive("heave")
    rows = [(1e9, 2, 0, 3), ((LET_GO + 3.5) * 1e9, 2, 1, 3)]
    words = "piloted goto none depth_hold"
    flown.streams[topics.STATUS.key] = stream(*STATUS, rows=rows, words=words)
    (stop,) = reviewed_stops(flown, sinking(0.5), None, settings(tmp_path), None).stops
    assert stop.bounced_back == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("mode", "stops"), [("heading_hold", 0), ("depth_hold", 1)])
def test_where_the_stick_is_a_force_coasting_is_no_stop(
    mode: FlightMode, stops: int, tmp_path: Path
) -> None:
    flown = dive("heave")
    words = f"piloted none {mode}"
    flown.streams[topics.STATUS.key] = stream(*STATUS, rows=[(0, 1, 0, 2)], words=words)
    flown.streams[topics.REFERENCE.key] = stream("valid_ns", "epoch", rows=[(0, 0)])
    found = reviewed_stops(flown, sinking(0.0), None, settings(tmp_path), None)
    assert len(found.stops) == stops
    assert any("is a force" in said for said in found.missing) == (stops == 0)


@pytest.mark.parametrize("seconds", [0.5, 2.0, 6.0])
def test_a_recording_that_ends_in_a_stop_ends_the_stop(seconds: float, tmp_path: Path) -> None:
    whole = sinking(0.5)
    there = LET_GO + seconds > T
    cut = Track(*(column[there] for column in whole))
    found = reviewed_stops(dive("heave"), cut, None, settings(tmp_path), None)
    assert len(found.stops) == (seconds > SHORTEST_S)
    for stop in found.stops:
        assert stop.ran_on == pytest.approx(SPEED * TAU * (1.0 - np.exp(-seconds / TAU)), rel=0.05)


def test_a_stop_in_which_the_motion_is_not_known_is_counted(tmp_path: Path) -> None:
    motion = sinking(0.0)
    motion.depth_rate[(LET_GO + 1.0 < T) & (LET_GO + 3.0 > T)] = nan
    found = reviewed_stops(dive("heave"), motion, None, settings(tmp_path), None)
    assert found.stops == []
    assert found.missing == [
        "Once a stick was let go, but the motion after it is not known throughout; that is left "
        "out."
    ]


def test_a_stop_upwards_is_the_same(tmp_path: Path) -> None:
    down = sinking(0.05)
    up = down._replace(depth=-down.depth, depth_rate=-down.depth_rate)
    stops = [
        reviewed_stops(dive("heave", full=full), motion, None, settings(tmp_path), None).stops[0]
        for motion, full in ((down, 1.0), (up, -1.0))
    ]
    assert stops[0].ran_on == stops[1].ran_on
    assert stops[0].bounced_back == stops[1].bounced_back


@pytest.mark.parametrize(("hz", "known"), [(100.0, True), (2.0, False)])
def test_of_an_axis_that_nothing_measures_only_the_jerk_is_known(
    hz: float, known: bool, tmp_path: Path
) -> None:
    """And not even that of slow samples: below 2 Hz they have as much of what is above."""
    t = np.arange(0.0, 20.0, 1.0 / hz)
    values = np.zeros((len(t), 6))
    values[:, 3] = np.sin(2.0 * pi * t)
    level = track(roll=np.zeros_like(T), pitch=np.zeros_like(T))
    imu = SensorColumns(t, t, values, 0)
    found = reviewed_stops(dive("surge"), level, imu, settings(tmp_path), None)
    assert "nothing in the recording measures surge" in found.missing[0]
    assert len(found.stops) == known
    if known:
        assert found.stops[0].ran_on is None
        # The jerk of sin(2π t) is 2π cos(2π t).
        assert found.stops[0].jerk == pytest.approx(2.0 * pi / np.sqrt(2.0), rel=0.1)


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    assert reviewed_stops(dive("yaw"), None, None, settings(tmp_path), None).missing != []
    still = track(depth=np.ones_like(T), depth_rate=np.zeros_like(T))
    found = reviewed_stops(dive("heave"), still, None, settings(tmp_path), None)
    assert found.stops == []
    assert found.missing == ["No stick was let go while the vehicle moved along its axis."]


@pytest.mark.parametrize(
    ("spans", "stops"),
    [([(0.0, 20.0)], 1), ([(0.0, LET_GO)], 0), ([(0.0, 2.0), (8.0, 20.0)], 0), ([], 0),
     ([(LET_GO + 1.0, 20.0)], 0), ([(2.0, 12.0)], 1)],
)  # fmt: skip
def test_a_stick_moves_an_armed_vehicle_only(
    spans: list[tuple[float, float]], stops: int, tmp_path: Path
) -> None:
    armed = [ArmedSpan(*span, ended=True) for span in spans]
    flown = dive("heave", armed=armed)
    found = reviewed_stops(flown, sinking(0.0), None, settings(tmp_path), armed)
    assert len(found.stops) == stops
    assert bool(found.missing) == (stops == 0)


def test_a_stick_against_the_motion_is_no_stop(tmp_path: Path) -> None:
    down = sinking(0.05)
    up = down._replace(depth=-down.depth, depth_rate=-down.depth_rate)
    found = reviewed_stops(dive("heave"), up, None, settings(tmp_path), None)
    assert found.stops == []
    assert found.missing[0].startswith("Once a stick was let go while the vehicle still moved")


def test_two_norths_and_two_surfaces_are_no_difference() -> None:
    turn, wave = 0.3 * T, np.sin(T)
    ours = track(bearing=turn, depth=wave, roll=0.1 * wave)
    own = track(bearing=turn + 1.2, depth=wave - 0.3, roll=0.1 * wave + 0.05)
    by = {each.name: each for each in beside(ours, own)}
    assert set(by) == {"heading", "depth", "roll"}
    assert by["heading"].rms == pytest.approx(0.0, abs=1e-9)
    assert by["heading"].offset == pytest.approx(-1.2, rel=1e-3)
    assert by["depth"].rms == pytest.approx(0.0, abs=1e-9)
    assert by["roll"].rms == pytest.approx(0.05, rel=1e-3)  # a roll has one zero


@given(st.floats(-20.0, 20.0), st.integers(-3, 3), st.integers(0, 99))
def test_headings_differ_by_half_a_turn_at_most(offset: float, turns: int, seed: int) -> None:
    walk = np.cumsum(np.random.default_rng(seed).standard_normal(len(T)))
    far = np.where(T > 7.0, 2.0 * pi * turns, 0.0)
    (found,) = beside(track(bearing=walk), track(bearing=np.zeros_like(T)))
    assert found.rms <= found.worst <= pi + 0.01
    assert abs(found.offset) <= pi + 0.01
    (found,) = beside(track(bearing=walk + far + offset), track(bearing=walk))
    assert found.rms == pytest.approx(0.0, abs=1e-9)


def test_a_heading_that_is_as_good_as_unknown_is_not_compared() -> None:
    known = Estimate(0.0, 0.1)
    for compass, std, expected in (
        (Estimate(1.0, 0.1), 0.1, 1.0),
        (Estimate(1.0, 0.6), 0.1, nan),
        (Estimate(1.0, 0.1, valid=False), 0.1, nan),
        (None, 0.1, 0.0),
        (None, 0.6, nan),
    ):
        states = Gathering(STATE)
        states.add(
            VehicleState(
                stamp_ns=1, sensor_ns=1, phase="running", depth=known, depth_rate=known,
                depth_acceleration=known, attitude=(1.0, 0.0, 0.0, 0.0), roll=known, pitch=known,
                heading=Estimate(0.0, std), heading_navigation=compass, yaw_rate=known,
            )
        )  # fmt: skip
        found = track_of(states.columns())
        assert found is not None
        assert found.bearing.tolist() == pytest.approx([expected], nan_ok=True)
        assert found.heading.tolist() == [0.0]  # of a stop: what it turned counts


@pytest.mark.parametrize("count", [1, 10, MOST_POINTS, 100_003])
def test_a_thinned_line_keeps_its_extremes(count: int) -> None:
    t = np.arange(float(count))
    values = np.random.default_rng(5).standard_normal(count)
    values[count // 2] = 50.0
    thin_t, thin = thinned(t, values)
    assert len(thin) <= MOST_POINTS + 2
    assert np.all(np.diff(thin_t) >= 0.0)
    assert 50.0 in thin
