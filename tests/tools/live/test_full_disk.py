"""A disk that is full costs what did not fit, and nothing else: no process, no file that was there,
no message that had been written."""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

import services.recorder.io.mcap_session
import services.visualizer.io.rrd_file
import tools.recordings.recording
from messages import events, topics
from messages.events import Event
from messages.link import LinkRequest
from services.recorder.foxglove.channel import foxglove_schema, is_view
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.visualizer.io.rrd_file import RrdFile
from tools.__main__ import main
from tools.live.outcome import Outcome
from tools.recordings.recording import is_whole, open_recording

SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.5,0\n20,0,0,0,0\n"


@pytest.fixture(params=["size=2m"])
def small_disk(tmp_path: Path, request: pytest.FixtureRequest) -> Generator[Path]:
    """A file system of 2 MB, or of what a test asks for."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount, umount = shutil.which("mount"), shutil.which("umount")
    if mount is None or umount is None:
        pytest.skip("there is no mount here")
    made = subprocess.run(
        [mount, "-t", "tmpfs", "-o", request.param, "tmpfs", str(disk)],
        check=False,
        capture_output=True,
    )
    if made.returncode != 0:
        pytest.skip("mounting a small file system is not allowed here")
    yield disk
    subprocess.run([umount, "-l", str(disk)], check=True)  # at once, even if it is still in use


def simulate(tmp_path: Path, out: Path) -> int:
    script = tmp_path / "sticks.csv"
    script.write_text(SCRIPT)
    return main(["simulate", "--pilot", f"script:{script}", "--seconds", "15", "--out", str(out)])


def record(path: Path, stamps: range) -> None:
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer", "link": "tether"})
    file.open_channel(topics.LINK_REQUEST.key, "LinkRequest", foxglove_schema(LinkRequest))
    for stamp in stamps:
        message = LinkRequest(stamp_ns=stamp, id="x", kind="up")
        file.write(topics.LINK_REQUEST.key, msgspec.json.encode(message), stamp, stamp, stamp)
    file.finish()


def read_by_others(path: Path) -> int:
    with path.open("rb") as stream:
        read = make_reader(stream).iter_messages()
        return sum(not is_view(channel.topic) for _, channel, _ in read)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:RRD file has no footer")
@pytest.mark.parametrize("warned", [True, False], ids=["seen to come", "unforeseen"])
def test_a_disk_that_fills_during_a_simulated_dive(
    small_disk: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    warned: bool,
):
    if not warned:  # as if somebody else had taken the room just then

        def see_nothing(_: Path, __: int) -> None:
            pass

        monkeypatch.setattr(services.recorder.io.mcap_session, "require_room", see_nothing)
        monkeypatch.setattr(services.visualizer.io.rrd_file, "require_room", see_nothing)
    (small_disk / "theirs.mcap").write_bytes(b"theirs")
    out = small_disk / "dive"
    status = simulate(tmp_path, out)
    said, complaint = capfd.readouterr()
    assert f"cannot write {out / 'dive.mcap'}: the disk is full" in said
    assert len(complaint.splitlines()) == 1
    recordings = list(out.glob("*.mcap"))
    assert recordings
    for path in recordings:
        assert is_whole(path)
        assert read_by_others(path) == sum(1 for _ in open_recording(path).raw()) > 1000
    if warned:
        assert status == 3
        assert f"the recording in {out} is incomplete: the disk was full" in complaint
        report = json.loads((out / "report.json").read_text())
        assert report["losses"]["not_recorded"] > 0
    else:
        assert status in {1, 3}
        assert str(out) in complaint
    assert all(path.stat().st_size > 0 for path in out.iterdir())
    assert (small_disk / "theirs.mcap").read_bytes() == b"theirs"
    if (out / "dive.rrd").exists():
        chunk = pytest.importorskip("rerun.chunk", reason="the viewer extra is not installed")
        assert list(chunk.RrdReader(str(out / "dive.rrd")).stream())


@pytest.mark.slow
@pytest.mark.parametrize("verb", [("simulate",), ("dive", "--headless"), ("up", "drone")])
@pytest.mark.parametrize("left", [0, 100_000])
def test_a_disk_that_is_full_before_the_dive_is_one_sentence_and_no_folder(
    small_disk: Path, tmp_path: Path, verb: tuple[str, ...], left: int
):
    with (small_disk / "theirs").open("wb", buffering=0) as file, suppress(OSError):
        while file.tell() < 2 * 2**20 - left and file.write(b"x" * 4096):
            pass
    (tmp_path / "sticks.csv").write_text(SCRIPT)
    ran = subprocess.run(
        [sys.executable, "-P", "-m", "tools", *verb, "--pilot", "script:sticks.csv", "--out",
         "disk/dive"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 1
    path = small_disk / "dive" / "dive.mcap"
    assert ran.stderr == f"lindy: cannot write the recording {path}: the disk is full\n"
    assert [path.name for path in small_disk.iterdir()] == ["theirs"]


def no_room(_: Path, __: int) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_parts_for_whose_copy_there_is_no_room_stay_and_are_reported_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    record(tmp_path / "dive.mcap", range(1, 20))
    record(tmp_path / "dive.part2.mcap", range(20, 40))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(tools.recordings.recording, "require_room", no_room)
    assert Outcome(Stack(out=str(tmp_path))).sum_up() == 3
    out, err = capsys.readouterr()
    assert f"cannot merge the recording in {tmp_path}: the disk is full; its parts stay" in out
    assert f"lindy: the recording in {tmp_path} is incomplete" in err
    assert {name: (tmp_path / name).read_bytes() for name in before} == before
    report = json.loads((tmp_path / "report.json").read_text())
    assert sum(topic["count"] for topic in report["topics"].values()) == 39


def test_a_report_for_which_there_is_no_room_leaves_no_half_of_one_and_is_summed_up(
    small_disk: Path, capsys: pytest.CaptureFixture[str]
):
    record(small_disk / "dive.mcap", range(1, 40))
    with (small_disk / "theirs").open("wb", buffering=0) as file, suppress(OSError):
        while file.write(b"x" * 512):
            pass
    with pytest.raises(LindyError, match=r"report\.json: the disk is full.*recording is kept"):
        Outcome(Stack(out=str(small_disk))).sum_up()
    assert {path.name for path in small_disk.iterdir()} == {"dive.mcap", "theirs"}
    said = capsys.readouterr().out
    assert said.startswith("Dive")
    assert "report.json" not in said


def stream(*messages: bytes) -> bytes:
    """As rerun encodes them."""
    framed = b"".join(
        (2).to_bytes(8, "little") + len(m).to_bytes(8, "little") + m for m in messages
    )
    return b"RRF2" + bytes(8) + framed + bytes(8) + (5).to_bytes(8, "little") + b"index" + bytes(32)


def test_a_viewer_s_file_leaves_out_what_does_not_fit_and_says_it_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    told: list[Event] = []
    lines: list[str] = []
    file = RrdFile(tmp_path / "dive.rrd", told.append, lambda _, text: lines.append(text))
    file.begin(stream(b"first"))
    with monkeypatch.context() as full:
        full.setattr(services.visualizer.io.rrd_file, "require_room", no_room)
        file.append(stream(b"second"))
        file.append(stream(b"third"))
    file.append(stream(b"fourth", b"fifth"))
    file.close()
    whole = stream(b"first", b"fourth", b"fifth")
    assert (tmp_path / "dive.rrd").read_bytes() == whole[: whole.index(bytes(8) + b"\x05")]
    assert told == [events.DISK_ERROR("dive.rrd")] * 2
    assert [line.rpartition(": ")[2] for line in lines[:1]] == ["the disk is full; it has a gap"]
    assert len(lines) == 2


def test_a_viewer_s_file_that_cannot_begin_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def make() -> RrdFile:
        return RrdFile(tmp_path / "dive.rrd", lambda _: None, lambda _, __: None)

    with pytest.raises(ValueError, match="in an unknown way"):
        make().begin(b"RRF9 and so on")
    monkeypatch.setattr(services.visualizer.io.rrd_file, "require_room", no_room)
    with pytest.raises(OSError, match="No space left"):
        make().begin(stream(b"first"))
    assert not any(tmp_path.iterdir())
