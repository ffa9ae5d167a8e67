"""The recorder beside a neighbour that speaks, on virtual time, writing real files."""

import errno
import json
from collections import defaultdict
from pathlib import Path

import pytest
from mcap.reader import make_reader

from messages import topics
from messages.health import LogLine
from messages.sensors import BatterySample, PressureSample
from services.recorder.io import mcap_file
from services.recorder.io.mcap_file import McapFile
from services.recorder.service import wire
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from tests.support.said import sticks
from tools.recordings.recording import log_hash, open_recording

SECOND = 1_000_000_000
HOME = ServiceSpec(["drone"])


class Dive:
    """A recorder and a neighbour that says its pressure 40 times a second."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.stack = Stack(out=str(folder), overrides=["control.depth.kp=3"])
        self.host = VirtualHost()
        self.lines: list[LogLine] = []
        self.neighbour = self.host.node("neighbour", ["drone"])
        say = self.neighbour.publisher(topics.PRESSURE)
        self.neighbour.every(
            40, lambda now: say.put(PressureSample(stamp_ns=now, pressure=101_325.0))
        )
        self.start()

    def start(self) -> None:
        self.recorder = self.host.add("recorder", HOME, self.stack)
        self.recorder.show = self.lines.append

    def run(self, until_s: float) -> None:
        self.host.run(round(until_s * SECOND))

    def crash(self, name: str = "dive.mcap") -> None:
        """End the recorder as kill −9 does: the file keeps what had reached the disk by now."""
        path = self.folder / name
        on_disk = path.read_bytes()
        self.host.kill("recorder")
        self.recorder.close()  # so that the file object writes nothing later
        path.write_bytes(on_disk)

    def stamps(self, name: str = "") -> list[int]:
        recorded = open_recording(self.folder / name)
        return [e.message.stamp_ns for e in recorded if e.key == topics.PRESSURE.key]


def refuse(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def ticks(until_s: float) -> list[int]:
    return [n * SECOND // 40 for n in range(1, round(until_s * 40) + 1)]


def test_a_foreign_reader_opens_the_file_and_finds_every_stream(tmp_path: Path):
    dive = Dive(tmp_path)
    dive.run(2.0)
    dive.host.close()
    with (tmp_path / "dive.mcap").open("rb") as stream:
        reader = make_reader(stream)
        found = list(reader.iter_messages())
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        about = {m.name: m.metadata for m in reader.iter_metadata()}
    assert {channel.topic for _, channel, _ in found} == {"sensor/pressure", "health/neighbour"}
    for schema, channel, message in found:
        assert channel.message_encoding == "json"
        assert schema is not None
        assert schema.encoding == "jsonschema"
        assert schema.name == topics.find(channel.topic).message.__name__  # type: ignore[union-attr]
        data = json.loads(message.data)
        assert message.publish_time == data["stamp_ns"]
        assert message.sequence == data["seq"]
        assert message.log_time >= message.publish_time
    assert dive.stamps() == ticks(2.0)
    assert attachments["pioneer.toml"] == dive.stack.vehicle_path.read_bytes()
    assert [row["key"] for row in json.loads(attachments["topics.json"])] == [
        topic.key for topic in topics.ALL
    ]
    assert about["dive"]["vehicle"] == "pioneer"
    assert json.loads(about["dive"]["overrides"]) == ["control.depth.kp=3"]
    assert about["clock"]["utc_minus_stamp_ns"] == "0"
    assert "arrival where" in about["clock"]["publish_time"]


def test_the_parts_of_a_dive_count_by_one_time_of_day_although_the_clock_was_set(tmp_path: Path):
    """A computer without a clock battery learns in mid-dive that it is not 1970."""
    host, stamps = VirtualHost(), list[int]()
    say = host.node("neighbour", ["drone"]).publisher(topics.PRESSURE)
    for offset_s in (3600, 1_700_000_000, -50):  # each in a new process of the recorder
        recorder = host.node("recorder", ["drone"])
        recorder.wall_offset_ns = offset_s * SECOND
        wire(recorder, Stack(out=str(tmp_path)))
        for _ in range(3):
            host.run(host.now + SECOND)
            say.put(PressureSample(stamp_ns=host.now, pressure=1.0))
            stamps.append(host.now)
        host.run(host.now + SECOND)
        host.kill("recorder")
        recorder.close()
    for name in ("dive.mcap", "dive.part2.mcap", "dive.part3.mcap"):
        entries = [e for e in open_recording(tmp_path / name) if e.key == topics.PRESSURE.key]
        assert [e.log_ns for e in entries] == [3600 * SECOND + ns for ns in stamps[:3]]
        del stamps[:3]


@pytest.mark.parametrize("side", ["drone", "topside"])
def test_with_two_clocks_every_publish_time_is_by_the_recorders(tmp_path: Path, side: str):
    """Before the two clocks are known, and for rows said on both sides, it is the arrival."""
    host, stack = VirtualHost({"drone": Skew(10**13)}), Stack(out=str(tmp_path))
    rows = Registry.read().apart()
    for name in ("tether", "link_monitor", "link_monitor_drone"):
        host.add(name, rows[name], stack)
    host.add("recorder", ServiceSpec([side]), stack)
    pilot, drone = host.node("pilot", ["topside"]), host.node("driver", ["drone"])
    down, up = pilot.publisher(topics.PILOT_COMMAND), drone.publisher(topics.BATTERY)
    pilot.every(50.0, lambda now: down.put(sticks(now)))
    drone.every(
        10.0, lambda now: up.put(BatterySample(stamp_ns=now, voltage=1, current=1, used_wh=1))
    )
    host.run(3 * SECOND)
    host.close()
    late = defaultdict[str, list[int]](list)
    for entry in open_recording(tmp_path):
        late[entry.key].append(entry.log_ns - entry.publish_ns)
    crossed = {"pilot/command", "link/clock", "clock/ping", "clock/pong", "sensor/battery"}
    assert crossed <= set(late)
    for key, delays in late.items():  # the link takes 1 ms and a bit
        assert all(-3_000_000 <= delay <= 8_000_000 for delay in delays), key
    assert set(late["health/pilot"]) == {0}
    there = "sensor/battery" if side == "topside" else "pilot/command"
    assert 0 < sum(delay == 0 for delay in late[there]) < len(late[there]) / 2
    # By this the recordings of both machines are brought together.
    said = open_recording(tmp_path).metadata("clock_offset")
    assert int(said["offset_ns"]) == pytest.approx(10**13, abs=2_000_000)
    assert 0 < int(said["bound_ns"]) < 5_000_000


def test_a_killed_recorder_has_lost_at_most_a_quarter_of_a_second(tmp_path: Path):
    dive = Dive(tmp_path)
    dive.run(1.99)
    dive.crash()
    assert dive.stamps() == [t for t in ticks(2.0) if t <= 1.8 * SECOND]


def test_no_file_that_is_there_is_written_to_or_removed(tmp_path: Path):
    theirs = {"dive.mcap": b"old" * 100_000, "dive.part3.mcap": b"old", "merging.mcap": b"x"}
    for name, data in theirs.items():
        (tmp_path / name).write_bytes(data)
    dive = Dive(tmp_path)
    dive.run(1.0)
    dive.crash("dive.part2.mcap")
    dive.start()
    dive.run(2.0)
    dive.host.close()
    assert {name: (tmp_path / name).read_bytes() for name in theirs} == theirs
    mine = {"dive.part2.mcap", "dive.part4.mcap"}
    assert {path.name for path in tmp_path.iterdir()} == mine | set(theirs)
    assert [t for name in sorted(mine) for t in dive.stamps(name)] == ticks(2.0)


def test_a_folder_that_cannot_be_written_is_one_sentence_that_names_the_file(tmp_path: Path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(LindyError, match=r"cannot write .*file/dive\.mcap"):
        Dive(tmp_path / "file")


def test_a_full_disk_in_mid_dive_is_counted_and_recording_goes_on_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    dive = Dive(tmp_path)
    dive.run(1.0)
    with monkeypatch.context() as full:
        full.setattr(McapFile, "flush", refuse)
        dive.run(7.0)
    dive.run(20.0)
    dive.host.close()
    errors = [line.text for line in dive.lines if line.level == "error"]
    assert len(errors) == 1
    assert "the disk is full" in errors[0]
    stamps = dive.stamps()
    lost = dive.recorder.counts["not_recorded"]
    assert set(stamps) <= set(ticks(20.0))
    assert len(stamps) == len(set(stamps))
    health = sum(e.key.startswith("health/") for e in open_recording(tmp_path))
    assert len(stamps) + health + lost == 20 * 40 + 20
    assert [t for t in stamps if t <= SECOND] == ticks(1.0)
    assert stamps[-1] == 20 * SECOND


def test_a_disk_with_room_for_a_beginning_gets_no_flood_of_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    dive = Dive(tmp_path)
    dive.run(1.0)
    flush = McapFile.flush
    with monkeypatch.context() as nearly_full:

        def refuse_messages(file: McapFile) -> None:
            if file.has_channel(topics.PRESSURE.key):
                refuse()
            flush(file)

        nearly_full.setattr(McapFile, "flush", refuse_messages)
        dive.run(40.0)
    dive.run(60.0)
    dive.host.close()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dive.mcap", "dive.part2.mcap"]
    assert [line.level for line in dive.lines] == ["error", "info"]
    health = sum(e.key.startswith("health/") for e in open_recording(tmp_path))
    assert len(dive.stamps()) + health + dive.recorder.counts["not_recorded"] == 60 * 41


def test_garbage_on_the_bus_is_counted_in_the_file_and_disturbs_nothing(tmp_path: Path):
    dive = Dive(tmp_path)
    foreign = dive.host.side("drone")
    dive.run(0.5)
    foreign.forward(Envelope("state", b"\xff\x00", topics.STATE.encoding))
    foreign.forward(Envelope("state", b"", "text/plain"))
    foreign.forward(Envelope("who/is/this", b"{}", ""))
    dive.run(1.0)
    dive.host.close()
    assert dive.stamps() == ticks(1.0)
    assert open_recording(tmp_path).losses() == {
        "malformed:state": 1,
        "wrong_type:state": 1,
        "unknown:who/is/this": 1,
    }


def test_started_again_on_a_full_disk_it_waits_for_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    dive = Dive(tmp_path)
    dive.run(1.0)
    dive.crash()
    with monkeypatch.context() as full:
        full.setattr(mcap_file, "write_at", refuse)
        dive.start()
        dive.run(3.0)
        assert [path.name for path in tmp_path.glob("*.mcap")] == ["dive.mcap"]  # no empty part
    dive.run(10.0)
    dive.host.close()
    assert dive.stamps("dive.part2.mcap")[-1] == 10 * SECOND
    assert dive.recorder.counts["disk_error"] >= 1


# The table [recorder] of a vehicle file.


@pytest.mark.parametrize("wrong", ["foxglove=3", "ring=5"])
def test_a_wrong_setting_is_one_sentence_that_names_it(tmp_path: Path, wrong: str):
    stack = Stack(out=str(tmp_path), overrides=[f"recorder.{wrong}"])
    with pytest.raises(LindyError, match=rf"--set recorder\.{wrong}"):
        VirtualHost().add("recorder", HOME, stack)
    assert list(tmp_path.iterdir()) == []


def test_without_foxglove_only_messages_are_recorded(tmp_path: Path):
    keys: list[set[str]] = []
    for name, settings in (("plain", ["recorder.foxglove=false"]), ("both", [])):
        host = VirtualHost()
        neighbour = host.node("neighbour", ["drone"])
        host.add("recorder", HOME, Stack(out=str(tmp_path / name), overrides=settings))
        neighbour.log("info", "words")
        host.run(SECOND)
        host.close()
        with (tmp_path / name / "dive.mcap").open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        keys.append({channel.topic for channel in summary.channels.values()})
    assert keys[1] - keys[0] == {"foxglove/log"}
    assert log_hash(tmp_path / "plain") == log_hash(tmp_path / "both")
