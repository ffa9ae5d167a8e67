"""Whatever happened to a file: every verb says so and reads the rest, and what is recovered was
recorded, and any reader opens it."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from messages import topics
from messages.sensors import PressureSample
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from tests.support.recorded import ShortDive, foreign
from tools.__main__ import main
from tools.log.cut import recovered
from tools.recordings.recording import is_whole, open_recording
from tools.replay.command import span_of
from tools.replay.source import open_source, remarks

KEY = topics.PRESSURE.key
CHUNKS, PER_CHUNK, PER_FLUSH = 3, 40, 10


def write(path: Path, first: int = 0) -> None:
    """Numbered samples, flushed as the recorder does."""
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer"})
    file.attach("topics.json", "application/json", b"[]")
    file.open_channel(KEY, "PressureSample", foxglove_schema(PressureSample))
    for n in range(first, first + CHUNKS * PER_CHUNK):
        sample = PressureSample(stamp_ns=n, pressure=1e5 + n)
        file.write(KEY, msgspec.json.encode(sample), 10 * n, n, n)
        if n % PER_FLUSH == PER_FLUSH - 1:
            file.flush()
        if n % PER_CHUNK == PER_CHUNK - 1:
            file.metadata("here", {"a chunk": "ends"})
    file.metadata("losses", {})
    file.metadata("hash", {"sha256": "abc"})
    file.finish()


@cache
def whole_file() -> tuple[bytes, list[int]]:
    """A file, and where each of its chunks ends."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "dive.mcap"
        write(path)
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        return path.read_bytes(), [
            chunk.chunk_start_offset + chunk.chunk_length for chunk in summary.chunk_indexes
        ]


@cache
def recorded() -> list[tuple[str, int, int, int, bytes]]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "dive.mcap"
        path.write_bytes(whole_file()[0])
        return foreign(path)


def mended(data: bytes) -> list[tuple[str, int, int, int, bytes]] | None:
    """What is read of it, and is in the new file. None: nothing could be recovered, and nothing was
    written."""
    with TemporaryDirectory() as folder:
        path, out = Path(folder) / "cut.mcap", Path(folder) / "mended.mcap"
        path.write_bytes(data)
        try:
            recovered(path, out)
        except LindyError:
            assert not out.exists()
            return None
        rows = [
            (raw.key, raw.log_ns, raw.publish_ns, raw.sequence, raw.data)
            for raw in open_recording(path).raw()
        ]
        assert rows == foreign(out)
        assert is_whole(path) == (len(data) == len(whole_file()[0]))
        return rows


def check_cut(at: int) -> None:
    """A file cut there gives the beginning of what was recorded, at least all whole chunks."""
    data, ends = whole_file()
    found = mended(data[:at]) or []
    assert found == recorded()[: len(found)]
    assert len(found) >= PER_CHUNK * sum(end <= at for end in ends)


@given(share=st.floats(min_value=0.0, max_value=1.0))
@example(share=0.0)
@example(share=1.0)
@settings(max_examples=60)
def test_a_file_cut_off_anywhere_is_mended(share: float) -> None:
    check_cut(round(share * len(whole_file()[0])))


@pytest.mark.parametrize("beside", [-1, 0, 1])
def test_a_file_cut_off_beside_the_end_of_a_record_is_mended(beside: int) -> None:
    data, _ = whole_file()
    at = 8
    while at + 9 < len(data):
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        check_cut(min(at + beside, len(data)))


@given(share=st.floats(min_value=0.0, max_value=1.0, exclude_max=True), bit=st.integers(0, 7))
@settings(max_examples=60)
def test_a_wrong_bit_costs_a_chunk_and_invents_nothing(share: float, bit: int) -> None:
    data = bytearray(whole_file()[0])
    data[int(share * len(data))] ^= 1 << bit
    found = mended(bytes(data))
    if found is not None:
        rest = iter(recorded())
        assert all(message in rest for message in found)


def test_what_follows_a_damaged_chunk_is_recovered(tmp_path: Path) -> None:
    data, ends = whole_file()
    broken = bytearray(data)
    broken[ends[0] - 20] ^= 0xFF
    path, out = tmp_path / "dive.mcap", tmp_path / "mended.mcap"
    path.write_bytes(broken)
    (said,) = recovered(path, out).wrong
    assert said.startswith("dive.mcap is damaged at byte ")
    assert said.endswith(": 40 of its 120 messages cannot be read")
    # The channel was described in that chunk; the summary describes it once more.
    assert foreign(out) == recorded()[PER_CHUNK:]


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_file_of_another_program_is_mended_too(
    tmp_path: Path, compression: CompressionType
) -> None:
    path, out = tmp_path / "other.mcap", tmp_path / "mended.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1000, compression=compression)
        writer.start()
        channel = writer.register_channel("/chatter", "ros1", 0)
        for n in range(200):
            writer.add_message(channel, n, f"number {n}".encode(), n)
        writer.finish()
    whole = foreign(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    recovered(path, out)
    found = foreign(out)
    assert 20 < len(found) < 200
    assert found == whole[: len(found)]


def test_where_no_message_can_be_read_the_damage_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, ends = whole_file()
    broken = bytearray(data)
    for end in ends:
        broken[end - 20] ^= 0xFF
    path = tmp_path / "dive.mcap"
    path.write_bytes(broken)
    assert main(["log", "export", "--as", "csv", str(path), "--out", str(tmp_path / "csv")]) == 1
    said = capsys.readouterr().err
    assert "holds no messages; dive.mcap is damaged at byte" in said
    assert "120 of its 120 messages cannot be read" in said


def test_all_parts_of_a_dive_become_one_file_with_its_attachments_once(tmp_path: Path) -> None:
    folder = tmp_path / "dive"
    folder.mkdir()
    write(folder / "dive.mcap")
    write(folder / "dive.part2.mcap", first=1000)
    cut = folder / "dive.part2.mcap"
    cut.write_bytes(cut.read_bytes()[:-100])
    out = tmp_path / "mended.mcap"
    assert recovered(folder, out).wrong == [
        "dive.part2.mcap was not finished: what was recorded last may be missing"
    ]
    assert len(foreign(out)) == 2 * CHUNKS * PER_CHUNK
    with out.open("rb") as stream:
        reader = make_reader(stream)
        assert [each.name for each in reader.iter_attachments()] == ["topics.json"]
        assert "hash" not in {each.name for each in reader.iter_metadata()}


@pytest.mark.parametrize(
    "data", [b"", b"\x89MCAP0", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(99)]
)
def test_nothing_to_recover_is_one_sentence(
    tmp_path: Path, data: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "dive.mcap", tmp_path / "mended.mcap"
    path.write_bytes(data)
    assert main(["log", "recover", str(path), "--out", str(out)]) == 1
    said = capsys.readouterr().err
    assert "nothing can be recovered" in said
    assert said.count("\n") == 1
    assert not out.exists()


def test_no_file_is_overwritten(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine.mcap"
    out.write_bytes(b"mine")
    for verb in ("recover", "cut"):
        assert main(["log", verb, str(dive.folder), "--out", str(out)]) == 1
        assert "it exists already" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"


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
    said = capsys.readouterr().out
    assert f"broken.mcap is damaged at byte {begin}" in said
    there, left = (sum(1 for _ in open_recording(each).raw()) for each in (whole, path))
    assert f": {there - left} of its {there} messages cannot be read" in said  # without views


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


@pytest.mark.parametrize("byte", range(2, 9))  # 1: less than what ends the frame
def test_what_follows_a_chunk_with_a_damaged_length_is_recovered(tmp_path: Path, byte: int) -> None:
    path, out = tmp_path / "whole.mcap", tmp_path / "mended.mcap"
    path.write_bytes(whole_file()[0])
    flipped(path, tmp_path / "broken.mcap", chunks_of(path)[1] + byte)
    found = recovered(tmp_path / "broken.mcap", out)
    assert found.wrong
    assert foreign(out) == recorded()[:PER_CHUNK] + recorded()[2 * PER_CHUNK :]


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
