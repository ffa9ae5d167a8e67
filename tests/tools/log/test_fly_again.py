"""A dive flown again from nothing but its recording is the same dive, bit for bit."""

import json
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import Writer

from services.marine.vehicle import Vehicle
from services.recorder.io.attachments import DIVE
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from tests.support.recorded import ShortDive
from tools.__main__ import main
from tools.choices import Choices
from tools.fly_again import fly_again
from tools.recordings.dive_file import flown_section
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import records
from tools.recordings.recording import open_recording


def attached(folder: Path) -> dict[str, Attachment]:
    """As a foreign reader finds them."""
    with (folder / "dive.mcap").open("rb") as stream:
        return {each.name: each for each in make_reader(stream).iter_attachments()}


def with_dive_file(
    dive: ShortDive,
    out: Path,
    other: str = "",
    times: int = 0,
    without: str = "",
    **changes: object,
) -> Path:
    """The same recording, whose attachment `dive.json` says something else.

    Args:
        other: attachment that says something else, too.
        times: [ns] of that.
        without: attachment that is left out.
    """
    with new_mcap(out) as copy:
        copy.next_file()
        for record in records(dive.folder / "dive.mcap"):
            if isinstance(record, Attachment) and record.name == DIVE:
                about = json.loads(record.data) | changes
                record.data = json.dumps(about).encode()
            if isinstance(record, Attachment) and record.name == other:
                record.data, record.create_time = record.data + b"\n", times
            if not (isinstance(record, Attachment) and record.name == without):
                copy.add(record)
    return out


def test_the_recording_carries_every_file_that_the_dive_was_flown_with(dive: ShortDive) -> None:
    found = attached(dive.folder)
    names = {"my_drone.toml", "first.toml", "first.csv", "second.toml", "second.csv", "box.toml"}
    assert {*names, "script.csv", "simulated.toml", "topics.json", DIVE} == found.keys()
    assert found["script.csv"].data.decode() == dive.script
    about = json.loads(found[DIVE].data)
    assert about["lindy"]["version"]
    assert about["stack"]["seed"] == 7
    assert about["stack"]["overrides"][1] == "control.depth.kp=3"


def test_it_is_the_same_dive_again(
    dive: ShortDive,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "--from", str(dive.folder), "--no-files"]) == 0
    assert f"the same as in {dive.folder}: {dive.log_hash[:16]}" in capsys.readouterr().out
    assert not [*tmp_path.iterdir()]


def test_its_recording_carries_the_same_files_so_that_it_can_be_flown_once_more(
    dive: ShortDive, tmp_path: Path
) -> None:
    assert fly_again(dive.folder, Choices(out=tmp_path / "again")) == 0
    before, after = attached(dive.folder), attached(tmp_path / "again")
    assert {name: each.data for name, each in after.items()} == {
        name: each.data for name, each in before.items()
    }
    for name in ("script.csv", "second.csv", "my_drone.toml"):
        assert after[name].create_time == before[name].create_time


@pytest.mark.slow
def test_another_gain_is_another_dive_and_that_is_said(dive: ShortDive, tmp_path: Path) -> None:
    about = json.loads(attached(dive.folder)[DIVE].data)
    lindy, stack = about["lindy"] | {"version": "0.0.9"}, about["stack"]
    stack["overrides"] = [stack["overrides"][0], "control.depth.kp=2.9"]
    changed = with_dive_file(dive, tmp_path / "changed.mcap", lindy=lindy, stack=stack)
    # Copied with its hash: `new_mcap` copies what it is given.
    with pytest.raises(LindyError, match=r"hash is not the same.*recorded with version 0\.0\.9"):
        fly_again(changed, Choices(), files=False)


@pytest.mark.slow
def test_without_the_script_the_recorded_sticks_are_flown(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    about = json.loads(attached(dive.folder)[DIVE].data)
    stack = about["stack"] | {"pilot": "gamepad", "virtual": False}
    flown = with_dive_file(dive, tmp_path / "piloted.mcap", stack=stack)
    assert fly_again(flown, Choices(), files=False) == 0
    said = capsys.readouterr().out
    assert "its sticks, of script script, are flown" in said
    assert "not compared: it was flown by the clock" in said


@pytest.mark.slow
def test_a_recording_runs_no_code_of_a_stranger_s_unless_it_is_trusted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ran = tmp_path / "ran.txt"
    (tmp_path / "stranger.py").write_text(
        f"import pathlib\npathlib.Path({str(ran)!r}).touch()\ndef wire(node, stack):\n    pass\n"
    )
    mine = tmp_path / "mine.toml"
    own = deploy_file("stacks", "simulated").read_text()
    mine.write_text(f'{own}\n[services.extra]\nsides = ["drone"]\nmodule = "stranger"\n')
    (tmp_path / "still.csv").write_text("t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0,0\n")
    words = ("--stack", str(mine), "--pilot", f"script:{tmp_path / 'still.csv'}", "--seconds", "1")
    assert main(["simulate", *words, "--out", str(tmp_path / "dive")]) in (0, 3)
    ran.unlink()
    sys.modules.pop("stranger")
    capsys.readouterr()
    again = ["simulate", "--from", str(tmp_path / "dive"), "--no-files"]
    assert main(again) == 1
    said = capsys.readouterr().err
    assert "would run code that is not Lindy's own: extra (module stranger); with --trust" in said
    assert not ran.exists()
    assert main([*again, "--trust"]) == 0
    assert "the same as in" in capsys.readouterr().out
    assert ran.exists()


def test_other_choices_are_refused(dive: ShortDive, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "--from", str(dive.folder), "--seed", "5"]) == 1
    assert "--seed: with --from everything but" in capsys.readouterr().err
    assert main(["simulate", "--from", str(dive.folder), "--seed", "3"]) == 1
    assert "--seed: with --from everything but --out is as the recording says" in (
        capsys.readouterr().err
    )


def test_a_recording_that_does_not_say_how_it_was_flown_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_message(writer.register_channel("/chatter", "ros1", 0), 0, b"said", 0)
        writer.finish()
    with pytest.raises(LindyError, match=r"foreign\.mcap does not say how it was flown"):
        fly_again(path, Choices())


def test_a_damaged_attachment_is_one_sentence(dive: ShortDive, tmp_path: Path) -> None:
    path = with_dive_file(dive, tmp_path / "wrong.mcap", "script.csv", 2**64 - 1)
    with pytest.raises(LindyError, match=r"wrong\.mcap: the attached .*script\.csv is damaged"):
        fly_again(path, Choices())


@pytest.mark.parametrize("name", ["my_drone.toml", "script.csv"])
def test_a_file_that_was_lost_is_not_taken_from_this_computer(
    dive: ShortDive, tmp_path: Path, name: str
) -> None:
    path = with_dive_file(dive, tmp_path / "wrong.mcap", without=name)
    with pytest.raises(LindyError, match=rf"wrong\.mcap: the attached .*{name} is damaged"):
        fly_again(path, Choices())


def test_a_lost_script_keeps_nobody_from_the_vehicle(dive: ShortDive, tmp_path: Path) -> None:
    path = with_dive_file(dive, tmp_path / "part.mcap", without="script.csv")
    found = flown_section(open_recording(path), "vehicle", Vehicle)
    assert found is not None
    assert found == flown_section(open_recording(dive.folder), "vehicle", Vehicle)


def test_no_other_file_is_taken_for_the_vehicle(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = with_dive_file(dive, tmp_path / "wrong.mcap", without="my_drone.toml")
    for verb in (["identify"], ["calibrate", "gyroscope"]):
        assert main([*verb, str(path)]) == 1
        said = capsys.readouterr().err
        assert "my_drone.toml is damaged; name one with --vehicle" in said
