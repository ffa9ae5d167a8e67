"""How each side of `lindy up` ends: the drone with a report, the topside with what only it saw."""

import json
import shutil
import signal
import subprocess
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from socket import gethostname

import pytest

from messages import topics
from messages.health import LogLine
from messages.link import Clock
from messages.vehicle import VehicleStatus
from tests.support.doors import free_endpoint
from tests.support.patience import PATIENCE_S, until
from tests.support.started import Started
from tools.__main__ import main
from tools.fleet.network import own_name
from tools.recordings.recording import is_whole, open_recording

pytestmark = pytest.mark.system

SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n0.5,0,0,0.8,0\n2,0,0,0,0\n4,0,0,0,0\n"
A_DAY_AHEAD = ("unshare", "--time", "--monotonic", "86400")  # [s] as another machine's clock is


def another_clock() -> tuple[str, ...]:
    """What gives a process a clock of its own, where Linux and our rights allow it."""
    if shutil.which("unshare") is None:
        return ()
    tried = subprocess.run([*A_DAY_AHEAD, "true"], check=False, capture_output=True)
    return A_DAY_AHEAD if tried.returncode == 0 else ()


def side(folder: Path, *words: str) -> Started:
    """`lindy up` as a user starts it."""
    return Started(folder, "up", *words)


def kill(side: Started, name: str) -> None:
    """… and wait until it is there again."""
    pid = side.pid(name)
    side.signal(name, signal.SIGKILL)
    side.until(lambda: side.pid(name) not in (None, pid))


@contextmanager
def drone_alone(folder: Path) -> Generator[Started]:
    with side(folder, "drone", "--listen", free_endpoint()) as drone:
        drone.until_said("calibrating")
        sizes = set[int]()  # [bytes] of the recording: its beginning, and two chunks of messages
        drone.until(lambda: len(grown(drone.out / "dive.mcap", sizes)) > 3)
        yield drone


def grown(file: Path, sizes: set[int]) -> set[int]:
    """The sizes that a file has been seen to have, with the present one added."""
    if file.exists():
        sizes.add(file.stat().st_size)
    return sizes


@pytest.mark.slow
def test_the_drone_reports_on_a_dive_whose_pilot_has_another_clock(tmp_path: Path):
    endpoint = free_endpoint()
    hands = "--connect", endpoint, "--grouped"  # one side is
    with ExitStack() as sides:
        drone = sides.enter_context(side(tmp_path / "drone", "drone", "--listen", endpoint))
        drone.until(lambda: drone.pid("recorder") is not None)
        topside = sides.enter_context(
            Started(
                tmp_path / "topside", "up", "topside", *hands, script=SCRIPT, before=another_clock()
            )
        )
        assert topside.process.wait(PATIENCE_S) == 0, topside.said
        assert drone.end(signal.SIGTERM) == 0, drone.said
    report = drone.report()
    assert report["exit"] == "clean"
    assert [stop["axis"] for stop in report["stops"]] == ["heave"]
    assert abs(report["stops"][0]["t"] - 2.0) < 0.5
    assert report["latency_ms"]["stick_to_thruster"]["p50"] > 0.0
    assert report["link"] == endpoint
    ends = "supervisor_drone: somebody on board ended the drone's side"
    for line in (
        ends,
        "ended cleanly",
        "report.json in",
        "elsewhere         only the topside knows its restarts",
    ):
        assert line in drone.said
    assert {path.stem for path in (topside.out / "logs").iterdir()} == {
        "hub_topside", "recorder_topside", "topside", "visualizer",
    }  # fmt: skip
    assert "on the drone" in topside.said
    assert not (topside.out / "report.json").exists()
    require_one_clock_in_each_recording(drone.out, topside.out)


def require_one_clock_in_each_recording(drone: Path, topside: Path) -> None:
    """Both sides are recorded, each by its own clock, with the offset of the two and its bound."""
    for folder in (drone, topside):
        assert is_whole(folder / "dive.mcap")
        recording = open_recording(folder)
        clocks = [entry.message for entry in recording if isinstance(entry.message, Clock)]
        assert clocks
        assert clocks[-1].offset_ns is not None
        assert 0 < (clocks[-1].bound_ns or 0) < 1_000_000_000
        late = {key: list[int]() for key in (topics.PILOT_COMMAND.key, topics.STATE.key)}
        for raw in recording.raw():
            if raw.key in late:
                late[raw.key].append(raw.log_ns - raw.publish_ns)
        for delays in late.values():
            assert len(delays) > 100
            assert all(abs(delay) < 5_000_000_000 for delay in delays)  # of a day between clocks
    heard = {raw.key for raw in open_recording(topside).raw()}
    assert topics.IMU.key not in heard
    assert {topics.STATE.key, topics.PREDICTION.key} <= heard


@pytest.mark.slow
def test_the_topside_says_what_was_restarted_and_where_the_report_is(tmp_path: Path):
    # A pad that is not plugged in: no script that would end, no window that needs a display.
    with side(
        tmp_path / "topside", "topside", "--connect", free_endpoint(), "--pilot", "gamepad"
    ) as topside:
        topside.until(lambda: topside.pid("link_monitor") is not None)
        topside.until((topside.out / "dive.mcap").exists)
        kill(topside, "link_monitor")
        kill(topside, "hub_topside")
        assert topside.end(signal.SIGINT) == 3, topside.said  # the hub heard nothing for a while
    lines = topside.said.splitlines()
    assert "ended; the drone was never heard, " in topside.said
    assert f"topside of {own_name('pioneer', gethostname())}, ended" in topside.said
    assert "restarted         hub_topside 1 × and link_monitor 1 ×" in lines
    heard = "what arrived here; the whole recording and report.json are on the drone"
    assert f"recorded          {heard}" in lines
    assert is_whole(topside.out / "dive.mcap")


@pytest.mark.slow
def test_a_drone_without_keys_says_so_from_its_start_to_its_summary(tmp_path: Path):
    endpoint = free_endpoint()
    with side(tmp_path / "drone", "drone", "--listen", endpoint, "--insecure") as drone:
        # Said once every service listens; a dive that is ended before that has no recorder yet.
        drone.until_said("INSECURE", "calibrating")
        assert drone.end(signal.SIGTERM) == 0, drone.said
    lines = drone.said.splitlines()
    assert any("INSECURE: whoever reaches this port can fly the drone" in line for line in lines)
    assert (
        "insecure          there were no keys: whoever reached the port could fly the drone"
        in lines
    )
    assert drone.report()["link"] == endpoint
    logged = [e.message for e in open_recording(drone.out)]
    assert any(isinstance(m, LogLine) and m.text.startswith("INSECURE") for m in logged)


@pytest.mark.slow
def test_who_is_not_on_the_drones_list_is_not_heard_and_is_named_in_its_log(tmp_path: Path):
    keys = tmp_path / "keys"
    assert main(["keys", "new", "--keys", str(keys)]) == 0
    endpoint = free_endpoint().replace("tcp/", "tls/")
    words = "--listen", endpoint, "--keys", str(keys)
    assert main(["keys", "revoke", "pilot:first", "--keys", str(keys)]) == 0
    with ExitStack() as sides:
        drone = sides.enter_context(side(tmp_path / "drone", "drone", *words))
        drone.until_said("calibrating")
        own = str(keys / "pilot-first")  # as on first's computer, which knows of no revocation
        words = "--connect", endpoint, "--keys", own, "--pilot", "gamepad"
        topside = sides.enter_context(side(tmp_path / "topside", "topside", *words))
        log = drone.out / "logs" / "hub_drone.log"
        drone.until(lambda: "pilot:first connected; it is not admitted" in log.read_text())
        topside.until(lambda: topside.pid("link_monitor") is not None)
        topside.end(signal.SIGINT)
        drone.end(signal.SIGTERM)
    assert "the drone was never heard" in topside.said
    assert "the topside was never heard" in drone.said


def learnt_at(drone: Started) -> int:
    """[ns] Time of the estimator's checkpoint."""
    return json.loads((drone.out / "checkpoints" / "estimation.json").read_bytes())["stamp_ns"]


@pytest.mark.slow
def test_a_drone_whose_supervisor_was_killed_goes_on_and_one_that_was_ended_calibrates(
    tmp_path: Path,
):
    endpoint = free_endpoint()
    with side(tmp_path / "first", "drone", "--listen", endpoint) as first:
        first.until_said("calibrated:")
        first.until(lambda: any(first.out.glob("checkpoints/estimation.json")))
        pids = first.running.pids.values()
        first.process.kill()
        first.process.wait(PATIENCE_S)
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids))
    with side(tmp_path / "second", "drone", "--listen", endpoint) as second:
        before = learnt_at(first)
        second.until(lambda: second.pid("recorder") is not None)
        second.until(
            lambda: learnt_at(second) > before
        )  # an estimator that calibrates learns later
        assert f"goes on with the calibration of {first.out}, which broke off" in second.said
        assert "calibrating" not in second.said
        assert second.end(signal.SIGTERM) == 0, second.said
    with side(tmp_path / "third", "drone", "--listen", endpoint) as third:
        third.until_said("calibrating")
        assert "goes on" not in third.said


@pytest.mark.slow
def test_a_supervisor_on_board_that_hangs_is_said_while_it_hangs(tmp_path: Path):
    """Nobody would start the services again, so whoever flies has to know."""
    with drone_alone(tmp_path / "drone") as drone:
        # Who was never heard cannot fall silent: `reference`, which watches, may begin late.
        drone.until(lambda: supervisor_heard_beside(topics.STATUS.key, drone) > 1)
        drone.process.send_signal(signal.SIGSTOP)
        try:
            until(lambda: "service_silent" in conditions(drone), lambda: drone.said)
        finally:
            drone.process.send_signal(signal.SIGCONT)
        assert drone.end(signal.SIGTERM) == 0, drone.said


def supervisor_heard_beside(key: str, of: Started) -> int:
    """How often the supervisor on board was recorded since the first message on a key."""
    keys = [each.key for each in open_recording(of.out)]
    since = keys.index(key) if key in keys else len(keys)
    return keys[since:].count("health/supervisor_drone")


def conditions(of: Started) -> set[str]:
    """All that its recording knows of so far."""
    told = (each.message for each in open_recording(of.out))
    return {name for each in told if isinstance(each, VehicleStatus) for name in each.conditions}
