"""What is in the file after each flush, for us and for the mcap library's own readers."""

import errno
import io
import random
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from messages import topics
from messages.sensors import PressureSample
from services.recorder.io import mcap_file
from services.recorder.io.mcap_file import McapFile
from tools.recordings.recording import is_whole, open_recording

KEYS = [topics.PRESSURE.key, "sensor/other"]


def opened(path: Path) -> McapFile:
    file = McapFile(path)
    file.attach("topics.json", "application/json", b"[]")
    for key in KEYS:
        file.open_channel(key, "PressureSample", b'{"type": "object"}')
    return file


def write(file: McapFile, stamps: range) -> None:
    for n in stamps:
        sample = PressureSample(stamp_ns=n, pressure=random.Random(n).gauss(1e5, 1.0))
        file.write(KEYS[n % 2], msgspec.json.encode(sample), 10 * n, n, n)


def foreign(path: Path) -> list[int]:
    """Publish times as the library reads a stream: to its end, or to where it is cut."""

    def read(stream: io.BufferedReader) -> Iterator[int]:
        with suppress(EndOfFile):
            for record in StreamReader(stream, validate_crcs=True).records:
                if isinstance(record, Message):
                    yield record.publish_time

    with path.open("rb") as stream:
        return list(read(stream))


def own(path: Path) -> list[int]:
    return [raw.publish_ns for raw in open_recording(path).raw()]


def test_after_every_flush_any_reader_finds_all_that_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(mcap_file, "CHUNK_BYTES", 5_000)  # so that some are closed in between
    file, path = opened(tmp_path / "dive.mcap"), tmp_path / "dive.mcap"
    for begin in range(0, 200, 8):
        write(file, range(begin, begin + 8))
        file.flush()
        assert foreign(path) == own(path) == list(range(begin + 8))
    file.finish()
    assert foreign(path) == own(path) == list(range(200))


def test_flushes_do_not_add_to_the_index(tmp_path: Path):
    file, path = opened(tmp_path / "dive.mcap"), tmp_path / "dive.mcap"
    for n in range(1000):
        write(file, range(n, n + 1))
        file.flush()
    file.finish()
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count == 1


def test_a_foreign_reader_finds_a_time_by_the_index(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(mcap_file, "CHUNK_BYTES", 5_000)
    file, path = opened(tmp_path / "dive.mcap"), tmp_path / "dive.mcap"
    write(file, range(2000))
    file.metadata("hash", {"sha256": "abc"})
    file.finish()
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        found = reader.iter_messages(KEYS[1], starting_at=5_000, ending_before=7_000)
        assert [m.publish_time for _, _, m in found] == list(range(501, 700, 2))
        assert [a.data for a in reader.iter_attachments()] == [b"[]"]
        own = {m.name: m.metadata for m in reader.iter_metadata()}
        assert own["hash"] == {"sha256": "abc"}
    assert summary is not None
    statistics = summary.statistics
    assert statistics is not None
    assert statistics.channel_message_counts == {1: 1000, 2: 1000}
    assert (statistics.message_start_time, statistics.message_end_time) == (0, 19_990)
    assert len(summary.chunk_indexes) > 10
    data = path.read_bytes()
    for chunk in summary.chunk_indexes:
        assert data[chunk.chunk_start_offset] == 0x06
        assert set(chunk.message_index_offsets) == {1, 2}
        assert all(data[at] == 0x07 for at in chunk.message_index_offsets.values())


@pytest.mark.parametrize("done", [0, 1, 200])
@pytest.mark.parametrize("killed", [True, False])
def test_what_is_killed_or_finds_no_room_within_a_flush_loses_only_that_flush(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, done: int, killed: bool
):
    """A flush is two writes, of which only the first `done` reach the file; on a full disk `done`
    bytes of the first one still find room."""
    file, path = opened(tmp_path / "dive.mcap"), tmp_path / "dive.mcap"
    write(file, range(500))
    file.flush()
    write(file, range(500, 600))
    write_at = mcap_file.write_at
    calls: list[int] = []

    def write_some(stream: io.FileIO, position: int, data: bytes) -> None:
        calls.append(position)
        if not killed:
            write_at(stream, position, data[:done])
            raise OSError(errno.ENOSPC, "No space left on device")
        if len(calls) <= min(done, 1):
            write_at(stream, position, data)

    with monkeypatch.context() as disk:
        disk.setattr(mcap_file, "write_at", write_some)
        if killed:
            file.flush()
            assert len(calls) == 2
            assert own(path) == list(range(500))
        else:
            with pytest.raises(OSError, match="No space"):
                file.flush()
            assert (file.flushed, file.unflushed) == (500, 100)
    file.abandon()
    assert is_whole(path)
    assert killed or foreign(path) == own(path) == list(range(500))
