"""What `lindy log info` says is what is in the file."""

from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from tools.__main__ import main
from tools.recordings.mcap_copy import new_mcap

from .conftest import ShortDive


def test_topics_and_attachments_are_counted(
    dive: ShortDive, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "info", str(dive.folder), "--json"]) == 0
    found = msgspec.json.decode(capsys.readouterr().out)
    with (dive.folder / "dive.mcap").open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        attached = {each.name for each in reader.iter_attachments()}
    assert summary is not None
    assert summary.statistics is not None
    counts = {
        summary.channels[number].topic: count
        for number, count in summary.statistics.channel_message_counts.items()
    }
    assert {key: topic["count"] for key, topic in found["topics"].items()} == counts
    assert {each["name"] for each in found["attachments"]} == attached
    assert found["topics"]["sensor/imu"]["type"] == "ImuSample"
    assert found["log_hash"] == dive.log_hash
    assert found["about"]["vehicle"] == "my_drone"
    assert found["dive"]["stack"]["seed"] == 7


def test_people_read_what_happened(dive: ShortDive, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "info", str(dive.folder)]) == 0
    said = capsys.readouterr().out
    assert "s  armed\n" in said
    assert "s  disarmed\n" in said
    assert "Lindy             0." in said
    assert "set               estimation.calibration.still_time=1, control.depth.kp=3" in said
    assert "sensor/imu" in said


def test_an_empty_or_a_missing_recording_is_no_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "empty.mcap"
    with new_mcap(path):
        pass
    assert main(["log", "info", str(path)]) == 0
    assert main(["log", "info", str(tmp_path)]) == 1
    assert "there is no recording in" in capsys.readouterr().err


@pytest.mark.parametrize("verb", ["info", "check", "csv", "sticks", "cut", "recover", "compare"])
@pytest.mark.parametrize("data", [b"", b"t,surge\n0,0\n", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x06"])
def test_what_is_no_recording_is_one_sentence_or_nothing_in_it(
    tmp_path: Path, verb: str, data: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dive.mcap"
    path.write_bytes(data)
    more = {
        "compare": [str(path)],
        "sticks": ["--out", str(tmp_path / "s.csv")],
        "cut": ["--out", str(tmp_path / "c.mcap")],
        "recover": ["--out", str(tmp_path / "r.mcap")],
    }.get(verb, [])
    status = main(["log", verb, str(path), *more])
    said = capsys.readouterr().err
    assert "an error in Lindy itself" not in said
    assert status == (0 if verb == "info" and data[:1] != b"t" else 1)
    assert said.count("\n") == status
    assert [each.name for each in tmp_path.iterdir()] == ["dive.mcap"]
