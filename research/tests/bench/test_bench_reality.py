"""Rough simulated dives, and real logs judged beside a smoother: on a dive that is known."""

from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy.api.dives import Stack
from lindy.api.messages import ImuSample, PressureSample
from lindy.api.recordings import open_recording
from lindy.api.vehicle import GRAVITY
from lindy_research.bench import reality, reality_real, reality_sim
from lindy_research.bench.reality_dives import (
    ALL_PAIRS,
    CASES,
    INCONSISTENT,
    LINKS,
    VEHICLES,
    drawn,
    fly,
    moves,
    overrides,
)
from lindy_research.bench.reality_logs import KnownLog, LoggedDive, judged, known
from lindy_research.bench.reality_smoother import rotations, smoothed
from lindy_research.releases import FULL, MOST, QUIET_S
from services.simulator.settings import Settings

SEEDS = st.integers(min_value=0, max_value=2**31)
SHORT = 1.0  # [s] the first move alone
HZ, SECONDS = 100, 24.0
SWING, TURN = 0.2, 1.3  # [rad], [rad/s] of roll; pitch as far, at 0.7 of the rate
HEAVE = 0.3  # [m] the same, of the depth
OWN_OFF = radians(2.0)  # [rad] by which the vehicle's own filter is off


@given(seed=SEEDS)
@settings(max_examples=20)
def test_what_a_seed_draws_can_be_simulated(seed: int) -> None:
    for case in (None, *CASES):
        c = drawn(seed, case)
        sea = Stack(vehicle=c.vehicle, overrides=overrides(c)).section("simulator", Settings)
        assert sea.pressure_std == c.pressure_std
        assert sea.waves == c.waves
        assert (sea.vibration is not None) is c.vibration


def test_every_vehicle_meets_every_link() -> None:
    met = {(drawn(seed).vehicle, drawn(seed).link) for seed in range(7, 7 + ALL_PAIRS)}
    assert met == {(vehicle, link) for vehicle in VEHICLES for link in LINKS}


@given(seed=SEEDS, vehicle=st.sampled_from(VEHICLES))
def test_no_pilot_flies_out_of_the_water_or_too_deep(seed: int, vehicle: str) -> None:
    depth, before = 0.0, 0.0
    for begin, move in moves(seed, vehicle, 200.0):
        assert begin >= before
        before = begin + move.seconds + QUIET_S
        ends = [*(t for t, _ in move.rows[1:]), move.seconds]
        assert all(t < end for (t, _), end in zip(move.rows, ends, strict=True))
        assert all(abs(part) <= 1.0 for _, sticks in move.rows for part in sticks)
        depth += FULL[vehicle] * sum(
            (end - t) * sticks[2] for (t, sticks), end in zip(move.rows, ends, strict=True)
        )
        assert 0.0 < depth <= MOST


def test_a_seed_gives_the_same_dive_again_and_its_recording(tmp_path: Path) -> None:
    path = tmp_path / "dive.mcap"
    # Over a link with little room what the recorder says of itself changes the dive.
    seed = next(seed for seed in range(ALL_PAIRS) if drawn(seed).link == "perfect")
    dive = fly(seed, seconds=SHORT, out=path)
    assert fly(seed, seconds=SHORT) == dive
    recorded = open_recording(path)
    assert recorded.metadata("hash")
    assert dive.armed
    assert dive.errors is not None
    assert dive.errors.depth < 0.1
    assert len(dive.stops) == 1
    assert dive.stops[0].bounce is not None
    said = {figure.name: figure for figure in reality.simulated([dive])}
    assert said["1 simulated dives, never armed"].met
    wrong = dive._replace(counts={INCONSISTENT: 1})
    said = {figure.name: figure for figure in reality.simulated([wrong])}
    assert said["1 simulated dives, IMU inconsistent"].met is False
    assert any(str(dive.seed) in line for line in reality_sim.table([wrong]))


@given(st.lists(st.floats(-7.0, 7.0), min_size=3, max_size=3), st.floats(-3.0, 3.0))
def test_turns_about_one_axis_add_up(vector: list[float], more: float) -> None:
    once, rest, whole = rotations(np.array([vector, np.array(vector) * more, vector]) * 1.0)
    np.testing.assert_allclose(once @ once.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(once @ rest, rest @ whole, atol=1e-12)
    np.testing.assert_allclose(once @ vector, vector, atol=1e-11)
    (both,) = rotations(np.array([vector]) * (1.0 + more))
    np.testing.assert_allclose(once @ rest, both, atol=1e-11)


def test_a_bias_of_the_gyroscope_is_not_in_the_reference_of_a_vehicle_that_turns() -> None:
    """Turns about the vertical with 0.1 rad of roll, to and fro, read by a gyroscope with the bias
    of the real one: 3.3 deg where it is left in."""
    turn = 1.2 * np.sign(np.sin(2.0 * np.pi * np.arange(0.0, 40.0, 0.01) / 20.0))  # [rad/s]
    sine, cosine = np.sin(0.1), np.cos(0.1)
    imu = [
        ImuSample(
            stamp_ns=10_000_000 * k,
            specific_force=(0.0, -GRAVITY * sine, -GRAVITY * cosine),
            angular_rate=(0.002, rate * sine - 0.0615, rate * cosine),
        )
        for k, rate in enumerate(turn.tolist())
    ]
    pressures = [PressureSample(stamp_ns=sample.stamp_ns, pressure=2e5) for sample in imu[::10]]
    found = smoothed(imu, pressures, (0.0, 0.0, 0.0), 0.0, 1000.0)
    np.testing.assert_allclose(found.roll, 0.1, atol=radians(0.15))
    np.testing.assert_allclose(found.pitch, 0.0, atol=radians(0.15))


# A bag as the vehicle's computer wrote it, of a dive that is known.


def written(folder: Path, *, second: int = 38, breaks: float = 1.0) -> Path:
    """A bag of a vehicle that rolls, pitches and heaves. `breaks`: factor of the gyroscope."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    path = folder / f"swing_2016-05-23-16-36-{second:02d}.bag"
    store, began = get_typestore(Stores.ROS1_NOETIC), 1_464_000_000_000_000_000
    kinds = store.types
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    rng = np.random.default_rng(5)

    def array(*values: float) -> Any:
        kind = kinds["std_msgs/msg/Float64MultiArray"]
        return kind(layout=layout, data=np.array(values))

    with Writer(path) as writer:
        links = {
            name: writer.add_connection(name, f"std_msgs/msg/{kind}", typestore=store)
            for name, kind in (
                ("/rovio/imu/data", "Float64MultiArray"),
                ("/rovio/water_pressure/data", "Float64"),
                ("/sensor_fusion/states", "Float64MultiArray"),
            )
        }

        def write(name: str, at: int, message: Any) -> None:
            data = store.serialize_ros1(message, message.__msgtype__)
            writer.write(links[name], at, data)

        for k in range(round(SECONDS * HZ)):
            at, (roll, pitch, depth, rate, force) = began + k * 1_000_000_000 // HZ, motion(k / HZ)
            rate = breaks * rate + rng.normal(0.0, 0.003, 3)
            force = force + rng.normal(0.0, 0.03, 3)
            write("/rovio/imu/data", at, array(1000.0 * k / HZ, *rate, *force))
            if k % 10 == 0:
                # The sensor is 0.2 m behind the origin, deeper as the nose rises, and 40 ms late.
                _, then, deep, *_ = motion(k / HZ - 0.04)
                below = deep + 0.2 * np.sin(then)
                said = kinds["std_msgs/msg/Float64"](data=9810.0 * below + rng.normal(0.0, 20.0))
                write("/rovio/water_pressure/data", at, said)
                own = (roll + OWN_OFF, pitch - OWN_OFF, 0.0, *rate, 0.0, 0.0, 0.0, depth)
                write("/sensor_fusion/states", at, array(*own))
    return path


def motion(t: float) -> tuple[float, float, float, Any, Any]:
    """Roll, pitch [rad], depth [m], angular rate [rad/s] and specific force [m/s²]."""
    a, b = TURN, 0.7 * TURN
    roll, pitch = SWING * np.sin(a * t), SWING * np.sin(b * t)
    roll_rate, pitch_rate = SWING * a * np.cos(a * t), SWING * b * np.cos(b * t)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    rate = np.array([roll_rate, pitch_rate * cr, -pitch_rate * sr])
    down = -HEAVE * b * b * np.sin(b * t) - 9.81  # [m/s²]
    return roll, pitch, 1.0 + HEAVE * np.sin(b * t), rate, down * np.array([-sp, sr * cp, cr * cp])


@pytest.fixture(scope="module")
def swing(tmp_path_factory: pytest.TempPathFactory) -> LoggedDive:
    return judged(KnownLog(written(tmp_path_factory.mktemp("logs")), "even"))


def test_a_dive_that_is_known_is_judged_as_it_was(swing: LoggedDive) -> None:
    assert (swing.unusable, swing.attitude, swing.inconsistent) == ("", 1.0, False)
    assert swing.imu_rate == pytest.approx(HZ, rel=1e-3)
    assert swing.start is not None
    # A smoother that shared the own filter's error, or an arm forgotten, would not give these.
    assert swing.own.roll == pytest.approx(OWN_OFF, rel=0.1)
    assert swing.own.pitch == pytest.approx(OWN_OFF, rel=0.1)
    assert swing.own.depth is not None
    assert swing.own.depth < 0.004
    assert swing.roll is not None
    assert degrees(swing.roll) < 1.0
    assert swing.depth_rate is not None
    assert swing.depth_rate < 0.1
    assert swing.thrown_away == 0.0


def test_a_gyroscope_that_is_wrong_shows(swing: LoggedDive, tmp_path: Path) -> None:
    wrong = judged(KnownLog(written(tmp_path, breaks=-1.0), "even"))
    assert wrong.inconsistent
    assert not swing.inconsistent


def test_a_folder_says_what_it_holds_and_a_table_what_came_of_it(
    swing: LoggedDive, tmp_path: Path
) -> None:
    for name in ("a_2016-05-23-16-36-38.bag", "a_2016-05-23-16-36-37.bag", "x.bag", "small.tlog"):
        (tmp_path / name).write_bytes(b"")
    logs, unknown = known(tmp_path)
    assert [log.part for log in logs] == ["odd", "even", "others"]
    assert unknown == ["x.bag"]
    empty = judged(logs[0])
    assert "empty" in empty.unusable
    said = "\n".join(reality_real.table([swing, empty], unknown))
    assert "2 known logs, 1 of which can be judged" in said
    assert "left alone: x.bag" in said
    assert "goal ≤ 0.5" in said
    wrong = "\n".join(reality_real.table([swing._replace(inconsistent=True)], []))
    assert swing.name in wrong


def test_without_real_dives_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("LINDY_REAL", raising=False)
    assert reality_real.main() == 2
    monkeypatch.setenv("LINDY_REAL", str(tmp_path / "none"))
    assert reality_real.main() == 2
    monkeypatch.setenv("LINDY_REAL", str(tmp_path))
    assert reality_real.main() == 2
    not_set, no_folder, nothing, _ = capsys.readouterr().err.split("\n")
    assert "LINDY_REAL is not set" in not_set
    assert "there is no such folder" in no_folder
    assert "none of its 0 files is known" in nothing


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_hull_that_accelerates_twice_as_its_file_says_keeps_its_imu(
    vehicle: str,
) -> None:
    """30 % less mass, half of the drag, 20 % more thrust, twice the lag, in calm water: the
    acceleration leans the specific force for longer than a fault of the gyroscope would take."""
    calm = (s for s in range(900, 1000) if (c := drawn(s)).vehicle == vehicle and not c.waves)
    dive = fly(next(calm), "light", 40.0)
    assert dive.armed
    assert INCONSISTENT not in dive.counts, (dive.seed, dive.counts)
    assert dive.errors is not None
    assert dive.errors.depth < 0.08
    assert max(dive.errors.roll, dive.errors.pitch) < radians(2.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [907, 931])
def test_a_vehicle_that_floats_with_28_degrees_of_pitch_stops_where_it_was_let_go(
    seed: int,
) -> None:
    """A BlueROV2 with 17 N more buoyancy and its centre of gravity 5 mm off: one stop ran on by
    0.43 m while an IMU's bias was not shared by the axes that lean. Both fly over the tether: over
    a link that loses the pilot, the link says when a stick was let go."""
    dive = fly(seed, "leaning", 60.0)
    assert dive.armed
    assert not dive.failsafes
    bounces = [stop.bounce for stop in dive.stops if stop.bounce is not None]
    assert len(bounces) > 2
    assert max(bounces) < 0.08
