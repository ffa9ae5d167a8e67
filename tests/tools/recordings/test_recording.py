"""What was written comes back, whole chunk by whole chunk, whatever happened to the file."""

from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Channel, Chunk
from mcap.writer import CompressionType, Writer

from messages import topics
from messages.sensors import PressureSample
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import MAGIC, McapFile
from services.runtime.config.errors import LindyError
from tools.recordings.mcap_records import Damage, Raw, records
from tools.recordings.recording import is_whole, log_hash, merge_parts, open_recording

PER_CHUNK, CHUNKS = 7, 5
KEY = topics.PRESSURE.key


def write(path: Path, first: int = 0, chunks: int = CHUNKS, sha256: str = "abc") -> None:
    """Chunks of PER_CHUNK samples, stamped first, first + 1, …"""
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer", "part": path.name})
    file.attach("topics.json", "application/json", b"[]")
    file.open_channel(KEY, "PressureSample", foxglove_schema(PressureSample))
    for n in range(first, first + chunks * PER_CHUNK):
        sample = PressureSample(stamp_ns=n, pressure=1e5 + n)
        file.write(KEY, msgspec.json.encode(sample), 10 * n, n, n)
        if (n - first) % PER_CHUNK == PER_CHUNK - 1:
            file.metadata("here", {"a chunk": "ends"})
    file.metadata("losses", {"overflowed:**": "2"})
    file.metadata("hash", {"sha256": sha256})
    file.finish()


def stamps(path: Path) -> list[int]:
    return [entry.message.stamp_ns for entry in open_recording(path)]


def test_a_message_comes_back_typed_with_its_times(tmp_path: Path):
    write(tmp_path / "dive.mcap")
    entry = list(open_recording(tmp_path))[3]
    assert entry == (KEY, PressureSample(stamp_ns=3, pressure=100_003.0), 30, 3)


def test_what_another_version_wrote_is_skipped_and_counted(tmp_path: Path):
    file = McapFile(tmp_path / "dive.mcap")
    file.open_channel("sensor/sonar", "Sonar", b"{}")
    file.open_channel(KEY, "PressureSample", b"{}")
    file.write("sensor/sonar", b"{}", 1, 1, 1)
    file.write(KEY, b'{"stamp_ns": "noon"}', 1, 1, 1)
    file.finish()
    recording = open_recording(tmp_path)
    assert list(recording) == []
    assert recording.unreadable == {"sensor/sonar": 1, KEY: 1}


def test_messages_that_nobody_wants_are_passed_over(tmp_path: Path) -> None:
    other, path = "sensor/other", tmp_path / "dive.mcap"
    file = McapFile(path)
    for key in (KEY, other):
        file.open_channel(key, "PressureSample", foxglove_schema(PressureSample))
    for n in range(60):
        file.write((KEY, other)[n % 3 == 0], b"x" * n, 10 * n, n, n + 5)
        if n % 11 == 10:
            file.metadata("here", {"a chunk": "ends"})
    file.finish()
    recording = open_recording(path)
    everything = list(open_recording(path).raw())
    assert [r.data for r in everything] == [b"x" * n for n in range(60)]
    assert list(recording.raw(other.__eq__)) == [r for r in everything if r.key == other]
    assert recording.damage == []
    assert recording.keys() == {KEY, other}


@given(st.integers(-5, 400), st.integers(-5, 400))
def test_chunks_outside_of_a_time_are_not_opened_and_all_within_it_is_given(a: int, b: int) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "dive.mcap"
        write(path)
        begin, end = min(a, b), max(a, b)
        keys: dict[int, str] = {}
        times: list[int] = []
        recording = open_recording(path)
        for record in recording.records(path, within=(begin, end)):
            if isinstance(record, Channel):
                keys[record.id] = record.topic
            elif isinstance(record, Raw):
                assert keys[record.channel_id] == KEY
                times.append(record.log_ns)
        wanted = [n for n in range(0, 10 * CHUNKS * PER_CHUNK, 10) if begin <= n < end]
        assert [n for n in times if begin <= n < end] == wanted
        assert len(times) <= len(wanted) + 2 * (PER_CHUNK - 1)
        assert recording.damage == []


@pytest.mark.parametrize("data", [b"t,surge,sway", b"\x89PNG\r\n\x1a\n" * 9])
def test_a_file_that_is_no_recording_is_one_sentence(tmp_path: Path, data: bytes):
    (tmp_path / "dive.mcap").write_bytes(data)
    with pytest.raises(LindyError, match=r"dive\.mcap is not a recording"):
        open_recording(tmp_path)


def test_a_chunk_that_says_more_than_100_mb_is_damage(tmp_path: Path):
    path, builder = tmp_path / "large.mcap", RecordBuilder()
    Chunk("zstd", zstandard.compress(bytes(1000)), 0, 0, 0, 400_000_000).write(builder)
    path.write_bytes(MAGIC + builder.end() + MAGIC)
    recording = open_recording(path)
    assert list(recording) == []
    assert recording.damage


def test_what_others_compress_by_lz4_is_read_and_a_damaged_chunk_of_it_is_damage(tmp_path: Path):
    path = tmp_path / "lz4.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4, enable_crcs=False)
        writer.start()
        schema = writer.register_schema("PressureSample", "jsonschema", b"{}")
        channel = writer.register_channel(KEY, "json", schema)
        for n in range(PER_CHUNK):
            sample = PressureSample(stamp_ns=n, pressure=1e5 + n)
            writer.add_message(channel, n, msgspec.json.encode(sample), n)
        writer.finish()
    assert stamps(path) == list(range(PER_CHUNK))
    data = path.read_bytes()
    at = data.index(b"\x04\x22\x4d\x18")  # how a frame of LZ4 begins
    path.write_bytes(data[: at + 4] + bytes(20) + data[at + 24 :])
    recording = open_recording(path)
    assert list(recording) == []
    assert recording.damage


def test_a_recording_that_is_still_written_is_no_damaged_one(tmp_path: Path) -> None:
    path = tmp_path / "dive.mcap"
    write(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    cut = Damage()
    assert sum(1 for _ in records(path, damage=cut)) > 0
    assert cut.in_words("a") == ["a was not finished: what was recorded last may be missing"]
    live, more = Damage(), whole[len(whole) // 2 :][:50]
    for number, _ in enumerate(records(path, damage=live)):
        if number == 0:
            path.write_bytes(path.read_bytes() + more)
    assert live.in_words("a") == ["a is still being written: look again when the dive has ended"]


def test_a_missing_recording_is_one_sentence(tmp_path: Path):
    with pytest.raises(LindyError, match="there is no recording in"):
        open_recording(tmp_path)
    with pytest.raises(LindyError, match=r"cannot read .*nothing\.mcap: No such file"):
        open_recording(tmp_path / "nothing.mcap")


def test_parts_are_read_one_after_the_other_and_in_the_order_of_their_numbers(tmp_path: Path):
    per_part = CHUNKS * PER_CHUNK
    for number in (10, 2, 1):
        name = "dive.mcap" if number == 1 else f"dive.part{number}.mcap"
        write(tmp_path / name, first=number * per_part)
    starts = [number * per_part for number in (1, 2, 10)]
    assert stamps(tmp_path) == [n for start in starts for n in range(start, start + per_part)]


def test_parts_are_merged_into_one_clean_file_that_keeps_a_cut_part_s_whole_chunks(
    tmp_path: Path,
):
    write(tmp_path / "dive.mcap")
    with (tmp_path / "dive.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    end = summary.chunk_indexes[3].chunk_start_offset + 5
    (tmp_path / "dive.mcap").write_bytes((tmp_path / "dive.mcap").read_bytes()[:end])
    write(tmp_path / "dive.part2.mcap", first=1000)
    before = list(open_recording(tmp_path))

    assert merge_parts(tmp_path)

    assert [path.name for path in tmp_path.iterdir()] == ["dive.mcap"]
    assert is_whole(tmp_path / "dive.mcap")
    assert list(open_recording(tmp_path)) == before
    with (tmp_path / "dive.mcap").open("rb") as stream:
        foreign = [m.publish_time for _, _, m in make_reader(stream).iter_messages()]
    assert foreign == [entry.publish_ns for entry in before]
    merged = open_recording(tmp_path)
    assert merged.metadata("merged") == {"dive.mcap": "21", "dive.part2.mcap": "35"}
    assert merged.metadata("dive")["vehicle"] == "pioneer"
    assert merged.losses() == {"overflowed:**": 2}
    assert merged.attachment("topics.json") == b"[]"
    assert log_hash(tmp_path) is None
    assert not merge_parts(tmp_path)


def test_a_whole_recording_is_left_alone(tmp_path: Path):
    write(tmp_path / "dive.mcap")
    before = (tmp_path / "dive.mcap").read_bytes()
    assert not merge_parts(tmp_path)
    assert (tmp_path / "dive.mcap").read_bytes() == before
    assert log_hash(tmp_path) == "abc"
