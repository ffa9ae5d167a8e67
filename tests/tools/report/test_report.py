"""The report of a small made-up dive, figure by figure."""

import json
from math import radians
from pathlib import Path
from typing import Any, Literal

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.control import ThrusterCommand
from messages.health import Health, LogLine
from messages.message import Estimate, Message
from messages.reference import Motion
from messages.sensors import BatterySample, PressureSample
from messages.state import VehicleState
from messages.vehicle import VehicleStatus
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from tests.support import said as told
from tools.analysis.dive import read_dive
from tools.health_sums import HealthOfAll
from tools.recordings.recording import open_recording
from tools.report.report import Extras, Report, encode, make_report
from tools.report.summary import summary

MS = 1_000_000  # [ns]
START = 5_000 * MS
KEYS = [
    "seconds", "armed_seconds", "drone", "vehicle", "link", "services", "topics", "latency_ms",
    "budget_ms", "clocks", "stops", "failsafes", "depth_error_rms_m", "heading_error_rms_deg",
    "peak_jerk_ratio", "smoothness", "energy", "holes", "losses", "troubles", "exit",
]  # fmt: skip
Said = list[tuple[str, Message]]
Level = Literal["info", "warning", "error"]


def record(folder: Path, said: Said, losses: dict[str, str] | None = None) -> Path:
    """A recording in which everything arrives when it is stamped."""
    folder.mkdir(exist_ok=True)
    file = McapFile(folder / "dive.mcap")
    file.metadata("dive", {"vehicle": "pioneer", "link": "tether"})
    for key, message in said:
        if not file.has_channel(key):
            file.open_channel(key, type(message).__name__, foxglove_schema(type(message)))
        stamp = message.stamp_ns
        file.write(key, msgspec.json.encode(message), stamp, stamp, message.seq)
    file.metadata("losses", losses or {})
    file.finish()
    return folder


def report_of(folder: Path, said: Said, extras: Extras | None = None) -> Report:
    return make_report(open_recording(record(folder, said)), extras or Extras())


def reference(
    stamp: int,
    *,
    sensor: int | None = None,
    pilot: int | None = None,
    armed: bool = True,
    depth: float = 0.0,
    heading: float = 0.0,
    jerk: tuple[float, float] = (0.0, 0.0),
) -> tuple[str, Message]:
    moves = Motion(depth, 0.0, 0.0, jerk[0], 1.5), Motion(heading, 0.0, 0.0, jerk[1], 4.0)
    fields = {"sensor_ns": sensor, "pilot_ns": pilot, "armed": armed}
    message = told.reference(stamp, depth=moves[0], heading=moves[1], **fields)
    return topics.REFERENCE.key, message


def log_line(service: str, level: Level, stamp: int = START) -> tuple[str, Message]:
    message = LogLine(stamp_ns=stamp, service=service, level=level, text="x")
    return f"log/{service}", message


def state(stamp: int, sensor: int, heading: float = 0.0) -> tuple[str, Message]:
    return topics.STATE.key, told.state(stamp, sensor_ns=sensor, heading=heading)


def truth(stamp: int, depth: float = 0.0, heading: float = 0.0) -> tuple[str, Message]:
    return topics.TRUTH.key, told.truth(stamp, depth, heading)


def command(stamp: int, sensor: int | None) -> tuple[str, Message]:
    message = ThrusterCommand(stamp_ns=stamp, sensor_ns=sensor, pilot_ns=None, thrust=(0.0,))
    return topics.THRUSTERS.key, message


def actuation(
    stamp: int,
    sensor: int | None = None,
    pilot: int | None = None,
    thrust: tuple[float, ...] = (),
    power: float = 0.0,
) -> tuple[str, Message]:
    fields = {"sensor_ns": sensor, "pilot_ns": pilot, "thrust": thrust, "power": power}
    done = None if sensor is None else stamp
    return topics.ACTUATION.key, told.actuation(stamp, actuated_ns=done, **fields)


def health(service: str, stamp: int, sent: int, **counts: int) -> tuple[str, Health]:
    at = stamp / MS
    figures = {"lateness_p50_ms": 0.1 * at, "cpu_percent": 10.0 * at, "rss_mb": 50.0}
    message = told.health(service, None, stamp_ns=stamp, sent=sent, counts=counts, **figures)
    return f"health/{service}", message


def one_way_through(sensor: int, pilot: int, delays: list[int]) -> Said:
    """State, reference, command and actuation of one sample, each so many ms after the last."""
    at = sensor
    stamps = [at := at + delay * MS for delay in delays]
    return [
        state(stamps[0], sensor),
        reference(stamps[1], sensor=sensor, pilot=pilot),
        command(stamps[2], sensor),
        actuation(stamps[3], sensor, pilot),
    ]


def test_a_report_has_exactly_the_promised_keys_in_their_order(tmp_path: Path):
    report = report_of(tmp_path / "a", [actuation(START)])
    assert list(json.loads(encode(report))) == KEYS
    simulated = report_of(tmp_path / "b", [], Extras(speedup=31.5, log_hash="abc"))
    assert list(json.loads(encode(simulated))) == [*KEYS, "speedup", "log_hash"]


def test_the_whole_length_and_the_armed_length_are_both_said(tmp_path: Path):
    armed = [False, True, True, False, True, False]
    said = [reference(START + n * 1000 * MS, armed=a) for n, a in enumerate(armed)]
    report = report_of(tmp_path / "armed", said)
    assert (report.seconds, report.armed_seconds) == (5.0, 3.0)
    assert (
        summary(report).splitlines()[0].split(maxsplit=1)[1].startswith("pioneer, 5 s, armed 3 s")
    )
    said = [reference(START + n * 1000 * MS, armed=False) for n in range(6)]
    report = report_of(tmp_path / "never", said)
    assert (report.seconds, report.armed_seconds) == (5.0, 0.0)
    assert "pioneer, 5 s, ended; never armed" in summary(report)


@given(
    delays=st.lists(st.lists(st.integers(1, 9), min_size=4, max_size=4), min_size=1, max_size=20)
)
@settings(max_examples=20, deadline=None)
def test_the_stages_of_every_sample_add_up_to_the_whole_way(
    delays: list[list[int]], tmp_path_factory: pytest.TempPathFactory
):
    said: Said = []
    for n, steps in enumerate(delays):
        sensor = START + n * 100 * MS
        said += one_way_through(sensor, sensor - 30 * MS, steps)
    latency = report_of(tmp_path_factory.mktemp("dive"), said).latency_ms
    stages = [
        "sensor_to_state",
        "state_to_reference",
        "reference_to_command",
        "command_to_thruster",
    ]
    for column, stage in enumerate(stages):
        assert latency.stages[stage].max == max(steps[column] for steps in delays)
    longest = max(sum(steps) for steps in delays)
    assert latency.sensor_to_thruster.max == longest
    assert latency.stick_to_thruster.max == longest + 30
    assert latency.stages["stick_to_reference"].max == max(s[0] + s[1] for s in delays) + 30


def test_a_latency_is_measured_once_per_cause_at_the_first_effect(tmp_path: Path):
    said = [
        actuation(START + 5 * MS, sensor=START, pilot=START),
        actuation(START + 50 * MS, sensor=START, pilot=START),  # the same command, still held
        actuation(START + 60 * MS),  # nobody's
        actuation(START + 107 * MS, sensor=START + 100 * MS, pilot=START + 100 * MS),
    ]
    spread = report_of(tmp_path, said).latency_ms.stick_to_thruster
    assert (spread.p50, spread.max) == (6.0, 7.0)


@given(
    pauses=st.lists(st.integers(1, 4000), min_size=1, max_size=20),
    armed_at=st.none() | st.integers(0, 19),
)
@settings(max_examples=30, deadline=None)
def test_every_second_without_any_message_is_in_the_report_and_never_called_no_losses(
    pauses: list[int], armed_at: int | None, tmp_path_factory: pytest.TempPathFactory
):
    times = [START + sum(pauses[:n]) * MS for n in range(len(pauses) + 1)]
    said = [reference(at, armed=n == armed_at) for n, at in enumerate(times)]
    began = times[armed_at] if armed_at is not None and armed_at < len(times) else START
    report = report_of(tmp_path_factory.mktemp("dive"), said)
    expected = [
        ((times[n] - began) / 1e9, (times[n + 1] - began) / 1e9)
        for n, pause in enumerate(pauses)
        if pause > 1000
    ]
    assert [(hole.begin, hole.end) for hole in report.holes] == [
        (pytest.approx(begin, abs=0.006), pytest.approx(end, abs=0.006)) for begin, end in expected
    ]
    (losses,) = [line for line in summary(report).splitlines() if line.startswith("events")]
    assert ("nothing was recorded from " in losses) == bool(expected)
    assert (losses.split() == ["events", "none"]) == (not expected)


def test_errors_compare_truth_with_the_reference_at_its_own_sample_while_armed(tmp_path: Path):
    said: Said = []
    for n in range(0, 1001, 50):  # the truth sinks at 1 m/s and turns at 1 rad/s, seen 20 times/s
        said += [truth(START + n * MS, depth=n / 1000, heading=n / 1000 + 2.0)]
        said += [state(START + n * MS, START + n * MS, heading=n / 1000)]
    for n in range(0, 1000, 10):
        late, depth, heading = START + (n + 400) * MS, n / 1000 - 0.1, n / 1000 - radians(3.0)
        said += [reference(late, sensor=START + n * MS, depth=depth, heading=heading)]
    wild = reference(START + 1400 * MS, sensor=START + 999 * MS, armed=False, depth=99.0)
    report = report_of(tmp_path, [*said, wild])
    assert report.depth_error_rms_m == pytest.approx(0.1)
    assert report.heading_error_rms_deg == pytest.approx(3.0)


def test_the_peak_jerk_is_the_worse_of_both_axes_and_only_while_armed(tmp_path: Path):
    said = [
        reference(START, jerk=(-0.9, 2.0)),
        reference(START + MS, jerk=(0.5, -3.0)),
        reference(START + 2 * MS, jerk=(50.0, 50.0), armed=False),
    ]
    report = report_of(tmp_path / "a", said)
    assert report.peak_jerk_ratio == pytest.approx(0.75)
    assert report_of(tmp_path / "b", said[2:]).peak_jerk_ratio is None


def test_energy_is_the_integral_over_time_and_thrusters(tmp_path: Path):
    said = [actuation(START + n * 500 * MS, thrust=(3.0, -4.0, 0.0), power=72.0) for n in range(21)]
    energy = report_of(tmp_path, said).energy
    assert energy.thrust_squared_n2s == pytest.approx(250.0)
    assert energy.wh == pytest.approx(0.2)


def test_topics_are_counted_and_their_rate_is_that_between_first_and_last(tmp_path: Path):
    said: Said = [
        (topics.PRESSURE.key, PressureSample(stamp_ns=START + n * 25 * MS, pressure=1.0))
        for n in range(41)
    ]
    report = report_of(tmp_path, [*said, truth(START)])
    assert msgspec.to_builtins(report.topics) == {
        "sensor/pressure": {"count": 41, "hz": 40.0},
        "simulator/truth": {"count": 1, "hz": None},
    }


def test_a_service_is_followed_through_its_restarts(tmp_path: Path):
    said: Said = [
        health("control", 1 * MS, sent=100, stale=1),
        health("control", 2 * MS, sent=200, stale=3),
        health("control", 3 * MS, sent=50, stale=2, lost=7),
    ]
    report = report_of(tmp_path, said, Extras(restarts={"control": 1, "gamepad": 2}))
    control = report.services["control"]
    assert (control.sent, control.restarts) == (250, 1)
    assert (control.lateness_p50_ms, control.lateness_p99_ms) == (0.2, None)
    assert (control.cpu_percent, control.rss_mb) == (20.0, 50.0)
    assert report.services["gamepad"].restarts == 2
    assert report.losses == {"stale": 5, "lost": 7}
    assert "restarted         control 1 ×\n                  gamepad 2 ×\n" in summary(report)


def test_losses_are_summed_by_name_over_everybody_who_counted(tmp_path: Path):
    said: Said = [
        health("control", MS, sent=1, stale=1),
        health("reference", MS, sent=1, stale=2, clamped=4),
    ]
    heard = HealthOfAll()
    heard.add(health("recorder", MS, sent=1, unknown=1, malformed=5)[1])
    extras = Extras(losses={"stale": 10, "crashed": 1}, health=heard.sums)
    record(tmp_path, said, losses={"unknown": "3"})
    report = make_report(open_recording(tmp_path), extras)
    expected = {"clamped": 4, "crashed": 1, "malformed": 5, "stale": 13, "unknown": 3}
    assert report.losses == expected
    assert report.services["recorder"].sent == 1


def test_an_imu_that_falls_silent_makes_no_dive_longer(tmp_path: Path) -> None:
    """Its last sample stays behind, but in the moments without any state."""
    stamps = [START + 10 * MS * k for k in range(101)]
    silent = [None if k % 30 == 0 else min(at, stamps[40]) for k, at in enumerate(stamps)]
    said = [reference(at, sensor=of) for at, of in zip(stamps, silent, strict=True)]
    assert report_of(tmp_path, said).armed_seconds == pytest.approx(1.0)


def test_the_deepest_is_of_a_depth_that_was_known(tmp_path: Path) -> None:
    """What is carried on after the last pressure sample is a guess that grows."""
    key, message = state(START, START)
    assert isinstance(message, VehicleState)
    said: Said = [
        (key, msgspec.structs.replace(message, stamp_ns=START + k * MS, depth=depth))
        for k, depth in enumerate(
            [Estimate(1.5, 0.01), Estimate(2.25, 0.01), Estimate(4.7, 3.6, valid=False)]
        )
    ]
    assert read_dive(open_recording(record(tmp_path, said))).max_depth_m == 2.25
    said = said[-1:]
    assert read_dive(open_recording(record(tmp_path / "lost", said))).max_depth_m is None


CLEAN = [
    actuation(START),
    reference(START),
    reference(START + 500 * MS),
    actuation(START + 900 * MS),
]


@pytest.mark.parametrize(
    ("more", "extras", "words"),
    [
        ([log_line("control", "warning")], Extras(), "ended cleanly"),
        ([log_line("supervisor", "error")], Extras(), "ended cleanly"),
        ([], Extras(losses={"saturated:port": 9, "lost:state": 3}), "ended cleanly"),
        ([log_line("control", "error")] * 2, Extras(), "ended; control logged 2 errors"),
        ([], Extras(restarts={"driver": 2}), "ended; driver started again 2 times"),
        ([], Extras(restarts=dict.fromkeys("abcd", 1)), "ended; 4 processes started again"),
        ([], Extras(gone=["control"]), "ended; control not alive at the end"),
        ([], Extras(finished=False), "ended; the recording was not finished"),
        ([], Extras(losses={"hung:control": 1}), "ended; control did not answer once"),
        ([], Extras(losses={"malformed:state": 1, "unknown:x": 2}), "ended; 3 messages refused"),
        ([], Extras(losses={"disk_error": 1}), "ended; not everything was recorded"),
        (
            [state(START + n * 100 * MS, START) for n in range(9, 51)]
            + [actuation(START + 5000 * MS)],
            Extras(),
            "ended; the vehicle was silent for 4.1 s",
        ),
        (
            [state(START + n * 100 * MS, START) for n in range(9, 90)],
            Extras(),
            "ended; the vehicle was silent for 8.0 s",
        ),
        ([actuation(START + 5000 * MS)], Extras(), "ended; the recording has a gap"),
        ([], Extras(exit="interrupted", restarts={"driver": 2}), "broke off: interrupted"),
    ],
)
def test_only_a_dive_without_trouble_ended_cleanly(
    tmp_path: Path, more: Said, extras: Extras, words: str
):
    first = summary(report_of(tmp_path, [*CLEAN, *more], extras)).splitlines()[0]
    assert first.split(", ", 3)[3] == words


def test_a_vehicle_that_says_nothing_at_all_is_no_clean_end(tmp_path: Path):
    said = [reference(START + n * 100 * MS) for n in range(21)]
    assert "ended; the vehicle was silent for 2.0 s" in summary(report_of(tmp_path, said))


def acting(t: float, **fields: Any) -> tuple[str, Message]:
    status = VehicleStatus(
        stamp_ns=START + round(t * 1e9), activity="piloted", armed=True, **fields
    )
    return topics.STATUS.key, status


def failsafe_row(tmp_path: Path, statuses: Said, name: str) -> str:
    text = summary(report_of(tmp_path, [*CLEAN, *statuses], Extras(losses={name: 1})))
    return next(line for line in text.splitlines() if line.startswith("failsafe"))


def test_a_failsafe_that_rose_after_it_had_held_is_said_to_have_risen(tmp_path: Path):
    stopped = acting(1.0, failsafe="pilot_lost", reaction="stop")
    row = failsafe_row(tmp_path / "held", [stopped, acting(3.0)], "failsafe:pilot_lost")
    assert "came to rest and held, first at 1.0 s, 2.0 s in all" in row
    rising = acting(2.0, failsafe="pilot_lost", reaction="ascend")
    row = failsafe_row(tmp_path / "rose", [stopped, rising, acting(3.0)], "failsafe:pilot_lost")
    assert "came to rest and held, then rose, first at 1.0 s, 2.0 s in all" in row


def test_a_failsafe_that_acted_too_late_to_be_counted_is_said_all_the_same(tmp_path: Path):
    stopped = acting(1.9, failsafe="pilot_lost", reaction="stop")
    text = summary(report_of(tmp_path, [*CLEAN, stopped, acting(2.0)], Extras()))
    assert "failsafe          1 × pilot lost" in text
    assert "ended cleanly" not in text


def test_a_failsafe_that_acts_later_is_said_to_have_been_noticed_before(tmp_path: Path):
    rising = acting(12.0, failsafe="leak", reaction="ascend", since_ns=START + 2_000 * MS)
    row = failsafe_row(tmp_path, [rising, acting(15.0)], "failsafe:leak")
    assert "the drone rose, noticed at 2.0 s, first at 12.0 s, 3.0 s in all" in row


def battery(at_s: float, used: float, capacity: float) -> tuple[str, Message]:
    return topics.BATTERY.key, BatterySample(
        stamp_ns=START + round(at_s * 1e9), voltage=16.0, current=1.0, used_wh=used,
        capacity_wh=capacity,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("used", "hours"),
    [
        ([1.0, 1.1, 1.2], 0.5),  # 0.2 Wh of 100 in 3.6 s
        ([1.0, 1.0, 92.0], None),  # a fault: nearly empty at once
        ([92.0, 1.0, 1.1], None),  # … and its end
        ([0.0, 2.0, 2.0], None),
        ([150.0, 150.1, 150.2], None),  # more than there is
        ([1.0, 1.0, 1.0], None),
        ([1.0, 1.05, 1.09], None),  # less than a gauge may count in
    ],
)
def test_a_full_battery_is_said_to_last_only_by_what_was_used_in_the_dive(
    tmp_path: Path, used: list[float], hours: float | None
):
    samples: Said = [battery(1.8 * n, wh, 100.0) for n, wh in enumerate(used)]
    report = report_of(tmp_path, [*CLEAN, *samples])
    assert report.energy.endurance_h == (None if hours is None else pytest.approx(hours))
    assert ("a full battery" in summary(report)) == (hours is not None)


@pytest.mark.parametrize(
    ("used", "capacity", "hours"),
    [
        (0.4, 266.0, 18.5),  # of a BlueROV2 at rest, in 100 s
        (0.3, 266.0, None),  # more than a day
        (28.0, 1e6, None),  # Minerva, fed from the ship
        (1100.0, 1e6, None),  # … after a day
    ],
)
def test_a_battery_that_would_last_longer_than_any_drone_s_is_not_said_to(
    tmp_path: Path, used: float, capacity: float, hours: float | None
):
    seconds = 100.0 if used < 1000.0 else 86_400.0
    said: Said = [battery(0.0, 0.0, capacity), battery(seconds, used, capacity)]
    found = report_of(tmp_path, [*CLEAN, *said]).energy
    assert found.battery_wh == pytest.approx(used)
    assert found.endurance_h == (None if hours is None else pytest.approx(hours, abs=0.1))


def test_figures_of_a_recording_that_the_disk_cut_short_are_said_to_be_those_of_its_part(
    tmp_path: Path,
):
    report = report_of(tmp_path, CLEAN, Extras(losses={"disk_error": 1}))
    report = msgspec.structs.replace(report, seconds=13.0, armed_seconds=3.0)
    first, second, *_ = summary(report).splitlines()
    assert "pioneer, recorded 13 s, armed 3 s of them, ended; " in first
    assert second.split(maxsplit=1)[1].endswith("all figures are of the recorded 13 s")
    assert "recorded" not in summary(msgspec.structs.replace(report, losses={}, troubles=[]))
