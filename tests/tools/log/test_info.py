"""What `lindy log info` says is what is in the file."""

from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from services.recorder.foxglove.channel import is_view
from tests.support.recorded import ShortDive, rewritten
from tools.__main__ import main
from tools.log.info import SeenEvent, as_text, info_of
from tools.recordings.mcap_records import Raw
from tools.recordings.recording import open_recording


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
        if not is_view(summary.channels[number].topic)
    }
    assert {key: topic["count"] for key, topic in found["topics"].items()} == counts
    assert {each["name"] for each in found["attachments"]} == attached
    assert found["topics"]["sensor/imu"]["type"] == "ImuSample"
    assert found["log_hash"] == dive.log_hash
    assert found["about"]["vehicle"] == "my_drone"
    assert found["dive"]["stack"]["seed"] == 7


def test_what_the_vehicle_did_is_shown_before_what_was_said_of_it(dive: ShortDive) -> None:
    said = [SeenEvent(float(t), "warning: tether: a typing error") for t in range(20)]
    acted = [SeenEvent(30.0, "failsafe pilot_lost: stop"), SeenEvent(31.0, "disarmed")]
    found = msgspec.structs.replace(info_of(open_recording(dive.folder)), events=[*said, *acted])
    shown = as_text(found)
    assert shown.index("9.00 s  warning") < shown.index("30.00 s  failsafe pilot_lost: stop")
    assert "31.00 s  disarmed" in shown
    assert "and 10 more" in shown


@pytest.mark.parametrize(
    "verb",
    [
        *("log info", "log check", "log export --as csv", "log export --as sticks"),
        *("log cut", "log recover"),
        *("log compare", "log film", "log snapshots", "identify", "simulate --from"),
    ],
)
@pytest.mark.parametrize("data", [b"", b"t,surge\n0,0\n", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x06"])
def test_what_is_no_recording_is_one_sentence_or_nothing_in_it(
    tmp_path: Path, verb: str, data: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dive.mcap"
    path.write_bytes(data)
    out = {
        "sticks": "s.csv",
        "cut": "c.mcap",
        "recover": "r.mcap",
        "film": "f.mp4",
        "snapshots": "p",
    }
    name = out.get(verb.split()[-1])
    more = ["--out", str(tmp_path / name)] if name else [str(path)] * (verb == "log compare")
    status = main([*verb.split(), str(path), *more])
    said = capsys.readouterr().err
    assert "an error in Lindy itself" not in said
    assert status == 1
    assert said.count("\n") == status
    assert [each.name for each in tmp_path.iterdir()] == ["dive.mcap"]


@pytest.mark.parametrize("tenth", range(1, 10, 2))
def test_what_a_file_that_was_cut_off_still_holds_is_read(
    dive: ShortDive, tmp_path: Path, tenth: int, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dive.mcap"
    data = (dive.folder / "dive.mcap").read_bytes()
    path.write_bytes(data[: tenth * len(data) // 10])
    holds = next(open_recording(path).raw(), None) is not None
    assert main(["log", "info", str(path)]) == 3
    assert "dive.mcap was not finished" in capsys.readouterr().out
    assert main(["log", "check", str(path)]) == (3 if holds else 1)
    assert main(["log", "export", "--as", "csv", str(path)]) == (3 if holds else 1)
    assert "an error in Lindy itself" not in capsys.readouterr().err


def test_a_message_of_an_older_lindy_is_counted_without_its_new_field(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What this version cannot read as its own type is still in tables, numbers and sizes."""

    def older(_: str, message: Raw) -> Raw:
        return message._replace(data=message.data.replace(b'"armed":', b'"was_armed":'))

    path = rewritten(dive, tmp_path / "older.mcap", older)
    assert main(["log", "check", str(path)]) == 0
    assert main(["log", "export", "--as", "csv", str(path)]) == 0
    assert main(["log", "info", str(path), "--json"]) == 0
    found = capsys.readouterr().out
    whole = msgspec.json.decode(found[found.index("\n{") :])
    assert whole["topics"]["reference"]["count"] > 400
    assert main(["log", "compare", str(path), str(path)]) == 0
