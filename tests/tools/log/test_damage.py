"""Every verb says where a recording is damaged or ends too early, and reads the rest."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from msgspec.structs import replace

from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from tools.__main__ import main
from tools.analysis.dive import RecordedDive, read_dive
from tools.log.compare import figures
from tools.log.recover import recovered
from tools.recordings.recording import open_recording
from tools.replay.command import span_of
from tools.replay.source import open_source, remarks
from tools.report import report_on
from tools.report.report import Extras, Report

from .conftest import ShortDive
from .test_recover import CHUNKS, KEY, PER_CHUNK, foreign, recorded, whole_file, write

IN_CHUNK = 80  # [bytes] behind the beginning of a chunk: in its data
VERBS = ["info", "check", "export --as csv", "cut", "compare", "export --as sticks"]


def chunks_of(path: Path) -> list[int]:
    """[bytes] Where they begin."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return [each.chunk_start_offset for each in summary.chunk_indexes]


def flipped(source: Path, out: Path, at: int) -> Path:
    data = bytearray(source.read_bytes())
    data[at] ^= 0x55
    out.write_bytes(data)
    return out


def arguments(verb: str, path: Path, folder: Path) -> list[str]:
    rest = {
        "export --as csv": ["--out", str(folder / "tables")],
        "cut": ["--out", str(folder / "part.mcap")],
        "compare": [str(path)],
        "export --as sticks": ["--out", str(folder / "again.csv")],
    }
    return ["log", *verb.split(), str(path), *rest.get(verb, [])]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_says_that_a_chunk_is_damaged(
    dive: ShortDive, tmp_path: Path, verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = dive.folder / "dive.mcap"
    begin = chunks_of(whole)[-1]
    path = flipped(whole, tmp_path / "broken.mcap", begin + IN_CHUNK)
    assert main(arguments(verb, path, tmp_path)) == 3
    assert f"broken.mcap is damaged at byte {begin}" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["info", "check", "export --as csv", "cut"])
def test_a_recording_that_ended_on_a_full_disk_was_not_finished(
    tmp_path: Path, verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dive.mcap"
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer"})
    file.open_channel(KEY, "PressureSample", b"{}")
    for n in range(20):
        file.write(KEY, b'{"stamp_ns": 1, "pressure": 1e5}', n, n, n)
    file.flush()
    file.abandon()
    assert main(arguments(verb, path, tmp_path)) == 3
    assert "dive.mcap was not finished" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_a_damaged_attachment_is_said(
    dive: ShortDive, tmp_path: Path, verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = dive.folder / "dive.mcap"
    at = whole.read_bytes().index(b"[vehicle]")
    path = flipped(whole, tmp_path / "broken.mcap", at)
    assert main(arguments(verb, path, tmp_path)) == 3
    assert "broken.mcap is damaged at byte " in capsys.readouterr().out
    assert recovered(path, tmp_path / "mended.mcap").wrong
    assert any("is damaged" in remark for remark in remarks(open_source(path)))


def test_of_a_whole_recording_nothing_is_said(dive: ShortDive) -> None:
    """Also of one with views for Foxglove, which are no messages of the bus."""
    assert remarks(open_source(dive.folder)) == []
    recording = open_recording(dive.folder)
    assert sum(1 for _ in recording) > 0
    assert recording.damage == []


def test_views_for_foxglove_are_not_missing_messages(tmp_path: Path) -> None:
    path = tmp_path / "dive.mcap"
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer"})
    for key in (KEY, "foxglove/pose"):
        file.open_channel(key, "PressureSample", b"{}")
        for n in range(20):
            file.write(key, b'{"stamp_ns": 1, "pressure": 1e5}', n, n, n)
    file.metadata("losses", {})
    file.finish()
    assert remarks(open_source(path)) == []


@pytest.mark.parametrize("byte", range(2, 9))  # 1: less than what ends the frame
def test_what_follows_a_chunk_with_a_damaged_length_is_recovered(tmp_path: Path, byte: int) -> None:
    path, out = tmp_path / "whole.mcap", tmp_path / "mended.mcap"
    path.write_bytes(whole_file()[0])
    flipped(path, tmp_path / "broken.mcap", chunks_of(path)[1] + byte)
    found = recovered(tmp_path / "broken.mcap", out)
    assert found.wrong
    assert foreign(out) == recorded()[:PER_CHUNK] + recorded()[2 * PER_CHUNK :]


@pytest.mark.parametrize("byte", range(2, 9))  # 1: less than what ends the frame
def test_a_chunk_with_a_damaged_length_in_a_file_without_an_end(tmp_path: Path, byte: int) -> None:
    path, out = tmp_path / "whole.mcap", tmp_path / "mended.mcap"
    write(path)
    begin = chunks_of(path)
    path.write_bytes(path.read_bytes()[: begin[2] + 40])
    flipped(path, tmp_path / "broken.mcap", begin[0] + byte)
    assert CHUNKS == 3
    # Its channel was described in the first chunk, and there is no summary.
    wrong = recovered(tmp_path / "broken.mcap", out).wrong
    assert any("40 messages of unknown topics" in said for said in wrong)


@pytest.mark.parametrize("at", range(9, 17))
def test_a_damaged_length_of_the_header_costs_no_message(tmp_path: Path, at: int) -> None:
    path, out = tmp_path / "whole.mcap", tmp_path / "mended.mcap"
    path.write_bytes(whole_file()[0])
    flipped(path, tmp_path / "broken.mcap", at)
    assert recovered(tmp_path / "broken.mcap", out).wrong
    assert foreign(out) == recorded()


def test_a_part_keeps_the_seconds_of_the_whole_in_a_replay(dive: ShortDive, tmp_path: Path) -> None:
    part = tmp_path / "part.mcap"
    assert main(["log", "cut", str(dive.folder), "--from", "1.5", "--out", str(part)]) == 0
    source = open_source(part)
    first, last = source.span
    begin, end = span_of(source, 2.0, 2.5)
    assert end - begin == 500_000_000
    assert begin - open_source(dive.folder).span[0] == 2_000_000_000
    assert span_of(source, None, None) == (first, last)
    assert span_of(source, None, 1e308) == (first, last)
    with pytest.raises(LindyError, match=r"begins at 1\.5 s"):
        span_of(source, None, 1.0)


def test_duplicates_are_in_the_table_of_check(
    dive: ShortDive, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["log", "check", str(dive.folder)])
    assert "duplicated" in capsys.readouterr().out


def test_losses_are_counted_by_the_rule_of_the_summary(
    dive: ShortDive, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = open_recording(dive.folder)
    counts = {"loss:state": 5, "resting:gyro_bias": 535}  # the second is no loss
    report = replace(report_on(read_dive(recording), Extras()), losses=counts)

    def same(_dive: RecordedDive, _extras: Extras) -> Report:
        return report

    monkeypatch.setattr("tools.log.compare.report_on", same)
    sides = figures(recording, recording)
    assert [each.a for each in sides if each.name.startswith("losses")] == [5.0]


def test_a_table_in_place_of_a_file_is_one_sentence(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine"
    out.write_bytes(b"mine")
    assert main(["log", "export", "--as", "csv", str(dive.folder), "--out", str(out)]) == 1
    assert "choose another --out" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"
