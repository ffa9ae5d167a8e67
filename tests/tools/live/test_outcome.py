"""A report that fails is one sentence, and never costs the recording."""

from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tools.live.outcome
from messages import topics
from messages.link import LatencyBudget
from messages.vehicle import Actuation, VehicleStatus
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import EndedByUserError, LindyError
from services.runtime.config.stack import Stack
from tools.live.outcome import Outcome, was_deaf
from tools.recordings.recording import open_recording
from tools.report.summary import lined_up


def record(path: Path, stamps: range) -> None:
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer", "link": "tether"})
    file.open_channel(topics.ACTUATION.key, "Actuation", foxglove_schema(Actuation))
    for stamp in stamps:
        message = Actuation(
            stamp_ns=stamp, thrust=(1.0,), actuated_ns=None, sensor_ns=None, pilot_ns=None,
            stale=False, power=1.0,
        )  # fmt: skip
        file.write(topics.ACTUATION.key, msgspec.json.encode(message), stamp, stamp, stamp)
    file.metadata("hash", {"sha256": "0"})  # as a recorder that ended by itself
    file.finish()


def seen(folder: Path) -> list[int]:
    return [entry.log_ns for entry in open_recording(folder)]


@pytest.mark.parametrize("exit_reason", ["clean", "the drone did not arm"])
def test_a_report_that_cannot_be_written_is_said_and_the_recording_kept(
    tmp_path: Path, exit_reason: str
):
    record(tmp_path / "dive.mcap", range(1, 40))
    (tmp_path / "report.json").mkdir()
    outcome = Outcome(Stack(out=str(tmp_path)))
    outcome.exit = exit_reason
    with pytest.raises(LindyError) as failure:
        outcome.sum_up()
    said = str(failure.value)
    assert f"cannot write {tmp_path / 'report.json'}" in said
    assert f"the recording is kept: dive.mcap in {tmp_path}" in said
    assert (exit_reason in said) == (exit_reason != "clean")
    assert seen(tmp_path) == list(range(1, 40))


def test_a_folder_that_was_removed_meanwhile_is_one_sentence(tmp_path: Path):
    outcome = Outcome(Stack(out=str(tmp_path / "gone")))
    with pytest.raises(LindyError, match=r"before anything was recorded in .*gone"):
        outcome.sum_up()
    assert outcome.sum_up_unrecorded("drone", "topside") == 0
    outcome.stopped = True  # Ctrl-C while the services start ends as any Ctrl-C does
    with pytest.raises(EndedByUserError):
        outcome.sum_up()


@pytest.mark.parametrize("step", ["merge_parts", "read_dive", "report_on", "summary"])
def test_a_mistake_of_ours_in_any_step_of_the_report_costs_no_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
):
    record(tmp_path / "dive.mcap", range(1, 20))
    record(tmp_path / "dive.part2.mcap", range(20, 40))

    def mistaken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(tools.live.outcome, step, mistaken)
    with pytest.raises(
        LindyError, match=r"ZeroDivisionError: division by zero.*is kept: dive\.mcap"
    ):
        Outcome(Stack(out=str(tmp_path))).sum_up()
    assert seen(tmp_path) == list(range(1, 40))


def test_a_service_that_cannot_start_is_one_sentence_and_no_dive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    record(tmp_path / "dive.mcap", range(0))
    outcome = Outcome(Stack(out=str(tmp_path)))
    with outcome.of_the_dive():
        raise LindyError("module bad: RuntimeError: it does not fit")
    with pytest.raises(LindyError, match=r"^module bad: RuntimeError: it does not fit$"):
        outcome.sum_up()
    assert capsys.readouterr().out == ""
    assert not (tmp_path / "report.json").exists()


def test_a_dive_that_broke_off_is_summed_up_and_then_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    record(tmp_path / "dive.mcap", range(1, 40))
    outcome = Outcome(Stack(out=str(tmp_path)))
    with outcome.of_the_dive():
        raise LindyError("control kept crashing")
    with pytest.raises(LindyError, match=r"^control kept crashing$"):
        outcome.sum_up()
    assert "broke off: control kept crashing" in capsys.readouterr().out
    assert (tmp_path / "report.json").is_file()


@given(st.dictionaries(st.sampled_from(["control", "gamepad"]), st.integers(0, 9)))
def test_only_a_recorder_or_a_hub_that_was_away_leaves_a_gap(others: dict[str, int]):
    assert not was_deaf({**others, "recorder": 0, "hub_drone": 0})
    assert was_deaf({**others, "recorder": 1})
    assert was_deaf({**others, "hub_topside": 1})


@pytest.mark.parametrize(
    ("side", "statuses", "words"),
    [
        ("topside", [], "ended; the drone was never heard"),
        ("topside", [False], "ended; never armed"),
        ("drone", [], "ended; never armed"),
        ("topside", [False, True, False], "ended cleanly"),
    ],
)
def test_a_side_without_a_recorder_ended_cleanly_only_if_the_drone_was_there_and_armed(
    capsys: pytest.CaptureFixture[str], side: str, statuses: list[bool], words: str
):
    outcome = Outcome(Stack())
    for armed in statuses:
        outcome.see_status(VehicleStatus(stamp_ns=0, armed=armed, activity="ready"), 0)
    assert outcome.sum_up_unrecorded(side, "other") == 0
    assert capsys.readouterr().out.splitlines()[0].endswith(f" of pioneer, {words}")


def test_both_machines_say_alike_how_long_the_pilot_saw_nothing(
    capsys: pytest.CaptureFixture[str],
):
    outcome = Outcome(Stack())
    outcome.see_status(VehicleStatus(stamp_ns=0, armed=True, activity="ready"), 0)
    unknown = dict.fromkeys(("down", "up", "stick_to_thruster_ms", "sensor_to_screen_ms"))
    outcome.see_latency(LatencyBudget(stamp_ns=0, bound_ms=None, lost_s=33.9, **unknown), 0)
    assert outcome.sum_up_unrecorded("topside", "drone") == 0
    words = "the pilot saw nothing of the drone for 33.9 s"
    assert lined_up([("link", words)]) in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("trouble", ["restarts", "hung"])
def test_a_service_that_did_not_work_for_a_while_costs_the_exit_status(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], trouble: str
):
    record(tmp_path / "dive.mcap", range(1, 40))
    outcome = Outcome(Stack(out=str(tmp_path)))
    assert outcome.sum_up() == 0
    (tmp_path / "report.json").unlink()
    setattr(outcome, trouble, lambda: {"control": 1})
    assert outcome.sum_up() == 3
    assert outcome.sum_up_unrecorded("drone", "topside") == 3
    words = {"restarts": "control started again once", "hung": "control did not answer once"}
    assert capsys.readouterr().out.count(words[trouble]) == 2
