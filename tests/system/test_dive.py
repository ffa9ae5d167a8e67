"""Real dives: separate processes over Zenoh on this machine, on wall time."""

import signal
import time
from pathlib import Path
from typing import Any

import pytest

from messages.state import VehicleState
from messages.topic import M
from messages.vehicle import VehicleStatus
from services.runtime.config.running import Running
from tests.support.doors import free_endpoint
from tests.support.patience import PATIENCE_S
from tests.support.started import Started, exists, lindy
from tools.recordings.recording import open_recording

pytestmark = pytest.mark.system

SCRIPT = """t,surge,sway,heave,yaw
0,0,0,0,0
0.5,0,0,0.8,0
2.5,0,0,0,0
3.5,0,0,0,0.4
4.5,0,0,0,0
6,0,0,0,0
"""
# It goes down for so long that a process is back meanwhile, on a busy computer too.
LONG_SCRIPT = """t,surge,sway,heave,yaw
0,0,0,0,0
0.5,0,0,0.8,0
8,0,0,0,0
9,0,0,0,0.4
10,0,0,0,0
11.5,0,0,0,0
"""
KEYS = {
    "seconds", "armed_seconds", "vehicle", "link", "services", "topics", "holes", "troubles",
    "latency_ms", "stops", "failsafes", "depth_error_rms_m",
    "budget_ms", "clocks", "heading_error_rms_deg", "peak_jerk_ratio", "energy", "losses", "exit",
}  # fmt: skip
SERVICES = {
    "simulator", "estimation", "reference", "control", "tether", "gamepad", "recorder",
    "visualizer", "link_monitor", "predictor",
}  # fmt: skip


def dive(folder: Path, *options: str, flies: str = SCRIPT) -> Started:
    return Started(folder / "out", "dive", "--headless", *options, script=flies)


def must_have_all(flown: Started, running: Running, report: dict[str, Any]) -> None:
    """What every dive that ends cleanly leaves behind, and nothing else."""
    assert set(running.pids) == SERVICES | {"hub_topside", "hub_drone"}
    assert not [name for name, pid in running.pids.items() if exists(pid)]
    files = {path.name for path in flown.out.iterdir()}
    assert files == {"dive.mcap", "dive.rrd", "report.json", "logs", "checkpoints"}
    assert set(report) >= KEYS
    assert report["exit"] == "clean"
    assert set(report["services"]) >= SERVICES
    acted = report["failsafes"]
    if acted and "the computer is too busy" in flown.said:
        pytest.skip(f"this computer stood still for so long that failsafes acted: {acted}")
    assert [stop["axis"] for stop in report["stops"]] == ["heave", "yaw"], (acted, flown.said)
    assert report["seconds"] > report["armed_seconds"] >= 6.0
    assert "Traceback" not in flown.said


@pytest.mark.parametrize("grouped", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_dive_ends_cleanly_with_all_its_files_and_leaves_no_process_behind(
    tmp_path: Path, *, grouped: bool
):
    with dive(tmp_path, *["--grouped"] * grouped) as flown:
        running = flown.until_armed()
        report = flown.report()
    must_have_all(flown, running, report)
    assert (len(set(running.pids.values())) < len(running.pids)) == grouped
    assert not any(service["restarts"] for service in report["services"].values())


@pytest.mark.slow
def test_a_killed_process_is_started_again_and_the_dive_goes_on(tmp_path: Path):
    with dive(tmp_path, flies=LONG_SCRIPT) as flown:
        running = flown.until_armed()
        kept = [flown.out / f"checkpoints/{name}.json" for name in ("estimation", "reference")]
        flown.until(lambda: all(path.is_file() for path in kept))
        killed_ns = time.monotonic_ns()
        flown.signal("control", signal.SIGKILL)
        flown.until_said("control is started again")
        report = flown.report(3)
    assert "control started again once" in flown.said
    must_have_all(flown, running, report)
    restarts = {name: service["restarts"] for name, service in report["services"].items()}
    assert {name: count for name, count in restarts.items() if count} == {"control": 1}
    assert "supervisor: control ended unexpectedly (signal SIGKILL)" in flown.said
    assert report["topics"]["log/supervisor"]["count"] >= 2  # one more where it was late
    assert "restarted         control 1 ×" in flown.said
    states = [m for m in open_messages(flown.out, VehicleState) if m.depth.valid]
    before = [m.depth.value for m in states if m.stamp_ns < killed_ns]
    after = [m.depth.value for m in states if m.stamp_ns > killed_ns]
    assert abs(after[0] - before[-1]) < 0.3, "it knows its depth again"
    assert max(after) > max(before), "it goes on down"
    statuses = [m for m in open_messages(flown.out, VehicleStatus) if m.stamp_ns > killed_ns]
    assert statuses[0].armed, "and was armed all the while"


def open_messages(folder: Path, kind: type[M]) -> list[M]:
    return [e.message for e in open_recording(folder) if isinstance(e.message, kind)]


@pytest.mark.slow
def test_a_recorder_that_hangs_is_named_and_the_gap_in_its_file_is_said(tmp_path: Path):
    with dive(tmp_path) as flown:
        flown.until_armed()
        flown.signal("recorder", signal.SIGSTOP)
        enough = time.monotonic() + 3.0  # [s] a gap that nobody overlooks
        flown.until_said("recorder does not answer any more")
        flown.until(lambda: time.monotonic() > enough)
        flown.signal("recorder", signal.SIGCONT)
        flown.until_said("recorder answers again")
        report = flown.report(3)
    assert report["exit"] == "clean"
    assert report["losses"]["hung:recorder"] == 1
    assert {"recorder did not answer once", "the recording has a gap"} <= set(report["troubles"])
    assert max(hole["end"] - hole["begin"] for hole in report["holes"]) > 2.0
    assert "ended cleanly" not in flown.said
    assert "nothing was recorded from " in flown.said


def ask(flown: Started, kind: str) -> int:
    """`lindy ask`. Returns its exit status."""
    return lindy("ask", kind, "--dive", str(flown.out)).returncode


@pytest.mark.slow
def test_with_any_process_stopped_the_drone_can_be_disarmed(tmp_path: Path):
    with dive(tmp_path, flies="t,surge,sway,heave,yaw\n0,0,0,0,0\n600,0,0,0,0\n") as flown:
        flown.until_armed()
        for name in ("control", "tether", "hub_topside", "hub_drone"):
            flown.signal(name, signal.SIGSTOP)
            assert ask(flown, "disarm") == 0, name
            flown.until_said(f"{name} is started again")
            flown.until(lambda: ask(flown, "arm") == 0)
        flown.process.send_signal(signal.SIGINT)
        report = flown.report(3)
    hung = {name for name in report["losses"] if name.startswith("hung:")}
    assert hung >= {
        "hung:control",
        "hung:tether",
        "hung:hub_topside",
        "hung:hub_drone",
    }  # a busy computer may stop others as well


@pytest.mark.slow
def test_two_dives_do_not_notice_each_other_and_a_port_is_of_one_alone(tmp_path: Path):
    words, endpoint = ("dive", "--headless", "--grouped"), free_endpoint()
    with (
        Started(tmp_path / "one", *words, "--listen", endpoint, script=SCRIPT) as one,
        Started(tmp_path / "two", *words, script=SCRIPT) as two,
    ):
        one.until(lambda: one.pid("reference"))
        third = Started(tmp_path / "third", *words, "--listen", endpoint)
        assert third.process.wait(PATIENCE_S) == 1
        sentence = third.said.strip().splitlines()[-1]
        assert sentence.startswith(f"lindy: endpoint {endpoint} is already in use")
        assert "Traceback" not in third.said
        reports = [one.report(), two.report()]
    for report in reports:
        assert report["exit"] == "clean"
        # Two dives starve a small computer: a pilot who is lost for a moment is one stop more.
        assert list(dict.fromkeys(stop["axis"] for stop in report["stops"])) == ["heave", "yaw"]
        foreign = ("unknown", "duplicated", "reordered", "wrong_type", "malformed")
        assert not [name for name in report["losses"] if name.startswith(foreign)]


@pytest.mark.slow
def test_ctrl_c_disarms_and_ends_the_dive_with_a_summary(tmp_path: Path):
    with dive(tmp_path) as flown:
        flown.until_armed()
        flown.process.send_signal(signal.SIGINT)
        flown.process.send_signal(signal.SIGTERM)  # an impatient second one costs nothing
        report = flown.report()
    assert report["exit"] == "clean"
    # On a busy computer so short a dive is over before its viewer is up, which is told.
    assert set(report["troubles"]) <= {"visualizer not alive at the end"}
    assert ("ended cleanly" in flown.said) == (not report["troubles"])
    assert "the report is being written" in flown.said
    armed = [status.armed for status in open_messages(flown.out, VehicleStatus)]
    assert True in armed
    assert armed[-1] is False
