"""Parts by size and time, and a recording that begins with the seconds before its trigger, on
virtual time, writing real files."""

import errno
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from messages import events, topics
from messages.health import LogLine
from messages.sensors import PressureSample
from messages.vehicle import VehicleStatus
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from tools.recordings.recording import is_whole, log_hash, merge_parts, open_recording

SECOND = 1_000_000_000
HOME = ServiceSpec(["drone"])


class Dive:
    """A recorder and a neighbour that says its pressure 40 times a second, with a temperature that
    hardly compresses, and that it is armed from `armed_s` to `disarmed_s`."""

    def __init__(
        self, folder: Path, *settings: str, armed_s: float = 1e9, disarmed_s: float = 1e9
    ) -> None:
        self.folder = folder
        self.stack = Stack(out=str(folder), overrides=[f"recorder.{s}" for s in settings])
        self.host = VirtualHost()
        self.lines: list[LogLine] = []
        self.neighbour = self.host.node("neighbour", ["drone"])
        say = self.neighbour.publisher(topics.PRESSURE)
        status = self.neighbour.publisher(topics.STATUS)
        self.neighbour.every(
            40, lambda now: say.put(PressureSample(stamp_ns=now, pressure=(now * 7919 % 10**9) / 7))
        )
        self.neighbour.every(
            5,
            lambda now: status.put(
                VehicleStatus(
                    stamp_ns=now, activity="ready", armed=armed_s <= now / SECOND < disarmed_s
                )
            ),
        )
        self.start()

    def start(self) -> None:
        self.recorder = self.host.add("recorder", HOME, self.stack)
        self.recorder.show = self.lines.append

    def run(self, until_s: float) -> None:
        self.host.run(round(until_s * SECOND))

    def crash(self, name: str) -> None:
        """End the recorder as kill −9 does: the file keeps what had reached the disk by now."""
        path = self.folder / name
        on_disk = path.read_bytes()
        self.host.kill("recorder")
        self.recorder.close()
        path.write_bytes(on_disk)

    @property
    def files(self) -> list[str]:
        return sorted(path.name for path in self.folder.iterdir())

    def stamps(self, name: str = "") -> list[int]:
        recorded = open_recording(self.folder / name)
        return [e.message.stamp_ns for e in recorded if e.key == topics.PRESSURE.key]


def ticks(until_s: float, since_s: float = 0.0) -> list[int]:
    times = [n * SECOND // 40 for n in range(1, round(until_s * 40) + 1)]
    return [time for time in times if time > since_s * SECOND]


def test_a_recording_goes_on_in_the_next_part_and_each_part_can_be_read_alone(tmp_path: Path):
    dive = Dive(tmp_path, "part_time=0.05")
    dive.run(10.0)
    dive.host.close()
    assert dive.files == ["dive.mcap", "dive.part2.mcap", "dive.part3.mcap", "dive.part4.mcap"]
    found: list[int] = []
    for name in dive.files:
        with (tmp_path / name).open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            rows = list(reader.iter_messages(topics.PRESSURE.key))
            attached = {a.name for a in reader.iter_attachments()}
            about = {m.name: m.metadata for m in reader.iter_metadata()}
        assert {"dive.json", "pioneer.toml", "topics.json"} <= attached
        assert about["rotation"] == {"part_time": "0.05"}
        assert {"dive", "clock", "losses"} <= set(about)
        for schema, channel, message in rows:
            assert schema is not None
            assert schema.name == "PressureSample"
            assert channel.message_encoding == "json"
            found.append(json.loads(message.data)["stamp_ns"])
    assert found == ticks(10.0)
    spans = [dive.stamps(name) for name in dive.files[:-1]]
    assert all(2.5 <= (span[-1] - span[0]) / SECOND <= 3.5 for span in spans)


def test_parts_on_request_stay_apart_and_have_the_hash_of_one_dive(tmp_path: Path):
    hashes: list[str | None] = []
    for name, settings in (("parts", ["part_time=0.05"]), ("one", [])):
        dive = Dive(tmp_path / name, *settings)
        dive.run(10.0)
        dive.host.close()
        hashes.append(log_hash(tmp_path / name))
        before = {path: path.read_bytes() for path in (tmp_path / name).iterdir()}
        assert not merge_parts(tmp_path / name)
        assert {path: path.read_bytes() for path in (tmp_path / name).iterdir()} == before
    assert hashes[0] == hashes[1] is not None
    (tmp_path / "parts" / "dive.part2.mcap").unlink()
    assert log_hash(tmp_path / "parts") is None


def test_a_killed_part_is_completed_alone(tmp_path: Path):
    dive = Dive(tmp_path, "part_time=0.05")
    dive.run(5.0)
    dive.crash("dive.part2.mcap")
    dive.run(6.0)
    dive.start()
    dive.run(8.0)
    dive.host.close()
    first = (tmp_path / "dive.mcap").read_bytes()
    before = dive.stamps()
    assert before[-1] == ticks(8.0)[-1]
    assert merge_parts(tmp_path)
    assert dive.files == ["dive.mcap", "dive.part2.mcap", "dive.part3.mcap"]
    assert all(is_whole(tmp_path / name) for name in dive.files)
    assert (tmp_path / "dive.mcap").read_bytes() == first
    assert dive.stamps() == before
    assert log_hash(tmp_path) is None


def test_a_part_ends_when_it_is_large(tmp_path: Path):
    dive = Dive(tmp_path, "part_size=1")
    say = dive.neighbour.publisher(topics.LOG.of("neighbour"))
    numbers = iter(range(10**9))

    def talk(now: int) -> None:  # hardly compressible
        text = "".join(f"{pow(next(numbers) + 1, 97, 2**61 - 1):x}" for _ in range(100))
        say.put(LogLine(stamp_ns=now, service="neighbour", level="info", text=text))

    dive.neighbour.every(100, talk)
    dive.run(30.0)
    dive.host.close()
    sizes = [(tmp_path / name).stat().st_size for name in dive.files]
    assert len(sizes) >= 3
    assert all(1e6 <= size <= 1.3e6 for size in sizes[:-1])
    assert dive.stamps() == ticks(30.0)


def test_losses_are_told_once_over_all_parts(tmp_path: Path):
    dive = Dive(tmp_path, "part_time=0.05")
    dive.run(1.0)
    dive.recorder.tell(events.MALFORMED("state"), 3)
    dive.run(4.0)
    dive.recorder.tell(events.MALFORMED("state"), 4)
    dive.run(8.0)
    dive.host.close()
    assert len(dive.files) == 3
    assert open_recording(tmp_path).losses() == {"malformed:state": 7}


def test_parts_never_overwrite_what_is_there(tmp_path: Path):
    theirs = tmp_path / "dive.part2.mcap"
    theirs.write_bytes(b"theirs")
    dive = Dive(tmp_path, "part_time=0.05")
    dive.run(8.0)
    dive.host.close()
    assert theirs.read_bytes() == b"theirs"
    assert dive.files == ["dive.mcap", "dive.part2.mcap", "dive.part3.mcap", "dive.part4.mcap"]


def test_a_ring_begins_with_the_seconds_before_the_trigger(tmp_path: Path):
    dive = Dive(tmp_path, "ring=5", armed_s=20.0, disarmed_s=21.0)
    dive.run(30.0)
    dive.host.close()
    stamps = dive.stamps()
    assert stamps == [t for t in ticks(30.0) if t >= stamps[0]]
    assert stamps[0] == pytest.approx(15.0 * SECOND, abs=0.3 * SECOND)
    (line,) = [line.text for line in dive.lines]
    assert line == "recording begins 5.0 s before this: the drone is armed"
    assert dive.recorder.counts["dropped:ring"] == 0


def test_a_ring_without_a_trigger_records_nothing(tmp_path: Path):
    dive = Dive(tmp_path, "ring=5")
    dive.run(10.0)
    dive.host.close()
    assert list(open_recording(tmp_path).raw()) == []
    assert is_whole(tmp_path / "dive.mcap")


def test_a_recording_that_has_begun_goes_on_after_a_restart(tmp_path: Path):
    dive = Dive(tmp_path, "ring=5", armed_s=6.0, disarmed_s=7.0)
    dive.run(8.0)
    dive.crash("dive.mcap")
    dive.start()
    dive.run(12.0)
    dive.host.close()
    assert dive.stamps("dive.part2.mcap") == ticks(12.0, 8.0)


def test_a_ring_without_room_counts_what_it_drops(tmp_path: Path):
    dive = Dive(tmp_path, "ring=600", "ring_size=1", armed_s=100.0)
    dive.run(101.0)
    dive.host.close()
    dropped = dive.recorder.counts["dropped:ring"]
    kept = sum(1 for _ in open_recording(tmp_path).raw())
    assert dropped > 0
    assert 1500 < kept < 3500
    assert kept + dropped == 101 * (40 + 5 + 1)
    assert open_recording(tmp_path).losses() == {"dropped:ring": dropped}


@pytest.mark.parametrize("wrong", ["part_size=0.5", "part_time=-1", "ring=601", "rings=3"])
def test_a_wrong_setting_is_one_sentence_that_names_it(tmp_path: Path, wrong: str):
    with pytest.raises(LindyError, match=rf"--set recorder\.{wrong}"):
        Dive(tmp_path, wrong)
    assert list(tmp_path.iterdir()) == []


def test_without_foxglove_only_messages_are_recorded(tmp_path: Path):
    for name, settings in (("plain", ["foxglove=false"]), ("both", [])):
        dive = Dive(tmp_path / name, *settings)
        dive.neighbour.log("info", "words")
        dive.run(1.0)
        dive.host.close()
    keys: list[set[str]] = []
    for name in ("plain", "both"):
        with (tmp_path / name / "dive.mcap").open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        keys.append({channel.topic for channel in summary.channels.values()})
    assert keys[1] - keys[0] == {"foxglove/log"}
    assert log_hash(tmp_path / "plain") == log_hash(tmp_path / "both")


@pytest.mark.parametrize("fails", ["finish", "__init__"], ids=["at the end", "at the beginning"])
def test_a_disk_that_fails_between_two_parts_costs_no_more_than_a_full_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
):
    dive = Dive(tmp_path, "part_time=0.05")
    dive.run(2.0)
    with monkeypatch.context() as full:

        def refuse(*_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        full.setattr(McapFile, fails, refuse)
        dive.run(7.0)
    dive.run(20.0)
    dive.host.close()
    (error,) = [line.text for line in dive.lines if line.level == "error"]
    assert "the disk is full" in error
    stamps, lost = dive.stamps(), dive.recorder.counts["not_recorded"]
    assert all(is_whole(tmp_path / name) for name in dive.files)
    assert set(stamps) <= set(ticks(20.0))
    assert [t for t in stamps if t <= 3 * SECOND] == ticks(3.0)
    assert stamps[-1] == 20 * SECOND
    assert sum(1 for _ in open_recording(tmp_path).raw()) + lost == 20 * (40 + 5 + 1)
    assert open_recording(tmp_path).losses()["not_recorded"] == lost > 0
    assert log_hash(tmp_path) is None
