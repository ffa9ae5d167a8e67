"""What a start writes for others: a note, a folder, a beat, who called; and to systemd."""

import itertools
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.running import RUNNING, Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import Heartbeat, last_beat
from services.runtime.hosts.process_host import CallerLog
from services.runtime.hosts.registry import Registry
from services.runtime.launch.local_stack import RETRY_NS, RunNote, Systemd
from services.runtime.launch.process_plan import PREFIX, Dive, ProcessPlan, runtime_folder
from tests.support.patience import until


def note_in(out: Path, warn: Callable[[str], None]) -> RunNote:
    return RunNote(ProcessPlan(Dive(Stack(out=str(out)), Registry.read()), out), warn)


def test_a_note_that_cannot_be_written_is_said_once_and_tried_again(tmp_path: Path) -> None:
    out, said, now = tmp_path / "dive", list[str](), itertools.count(0, RETRY_NS // 10)
    note = note_in(out, said.append)
    until(lambda: note.update({"control": 7}, next(now)) or said)
    for _ in range(30):
        note.update({"control": 7}, next(now))
    out.mkdir()
    until(lambda: note.update({"control": 7}, next(now)) or (out / RUNNING).exists())

    def noted() -> dict[str, int]:
        return msgspec.json.decode((out / RUNNING).read_bytes(), type=Running).pids

    assert noted() == {"control": 7}
    until(lambda: note.update({"control": 8}, next(now)) or noted() == {"control": 8})
    note.update({"control": 8}, next(now))  # the write before is known to have ended well
    (out / "run.new").write_text("of somebody else")
    shutil.move(out, tmp_path / "away")  # a second time it is said again
    until(lambda: note.update({"control": next(now)}, next(now)) or len(said) == 2)
    shutil.move(tmp_path / "away", out)
    note.remove()
    assert [path.name for path in out.iterdir()] == ["run.new"]
    assert said == [f"cannot write {out / RUNNING}: no such file or directory"] * 2


def test_a_disk_that_hangs_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / ".run.json.new")  # whoever opens it waits for a reader
    note = note_in(tmp_path, print)
    now = itertools.count(0, RETRY_NS)
    for pid in range(5):
        note.update({"control": pid}, next(now))  # returns
    assert not (tmp_path / RUNNING).exists()
    reader = os.open(tmp_path / ".run.json.new", os.O_RDONLY | os.O_NONBLOCK)
    until(lambda: note.update({"control": 5}, next(now)) or (tmp_path / RUNNING).exists())
    os.close(reader)


# What a start leaves behind that was killed is removed by the next one, and nothing else is.


KILLED = """
import os
from services.runtime.launch.process_plan import runtime_folder
with runtime_folder() as folder:
    (folder / "control.beat").write_text("1")
    print(folder, flush=True)
    input()
"""


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Generator[Path]:
    with tempfile.TemporaryDirectory(prefix="t-") as name:  # short, as a socket's folder must be
        monkeypatch.setattr(tempfile, "tempdir", name)
        monkeypatch.setenv("TMPDIR", name)
        yield Path(name)


def started() -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", KILLED],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_the_folder_of_a_start_that_was_killed_is_removed_by_the_next(place: Path) -> None:
    process, left = started()
    with runtime_folder() as ours:
        assert left.exists()  # it lives
        assert ours.parent == left.parent == place
    assert not ours.exists()
    process.kill()
    process.communicate()
    assert left.exists()
    with runtime_folder() as ours:
        assert [each.name for each in place.iterdir()] == [ours.name]


def test_nothing_else_is_removed(place: Path) -> None:
    others = [place / f"{PREFIX}new", place / "lindy-x", place / "of-somebody"]
    for folder in others:
        folder.mkdir()
    for folder in others[1:]:
        (folder / "file").write_text("kept")
    pointer = place / f"{PREFIX}pointer"
    pointer.symlink_to(others[2])
    (place / f"{PREFIX}file").write_text("kept")
    with runtime_folder() as ours:
        assert {each.name for each in place.iterdir()} == {
            ours.name, f"{PREFIX}new", "lindy-x", "of-somebody", pointer.name, f"{PREFIX}file",
        }  # fmt: skip
    assert (others[2] / "file").read_text() == "kept"


# A sign of life in a file: what was written last is read, and no file is no error.


def test_the_newest_beat_is_read_and_a_new_life_begins_without_one(tmp_path: Path) -> None:
    path = tmp_path / "control.beat"
    assert last_beat(path) is None
    for _ in range(2):
        heartbeat = Heartbeat(path)
        assert last_beat(path) is None
        for now in (1, 2**62, 5):
            heartbeat.beat(now)
            assert last_beat(path) == now


def test_where_no_file_can_be_made_nothing_is_watched_and_nothing_fails(tmp_path: Path) -> None:
    path = tmp_path / "no such folder" / "control.beat"
    heartbeat = Heartbeat(path)
    heartbeat.beat(7)
    assert heartbeat.unwatched.startswith("nobody would notice if it hung: cannot write ")
    assert Heartbeat(None).unwatched == ""
    assert last_beat(path) is None


# Who comes to a hub from another machine is in its log.


def test_a_caller_who_tries_for_hours_fills_no_log(capsys: pytest.CaptureFixture[str]) -> None:
    callers = CallerLog(["pilot:ann"])
    for _ in range(150):
        callers.see("pilot:eve", True)
    callers.see("pilot:ann", True)
    callers.see("pilot:ann", False)
    said = capsys.readouterr().err.splitlines()
    refused = "it is not admitted, and can neither hear nor say anything"
    assert said == [
        f"warning hub: pilot:eve connected; {refused}",
        f"warning hub: pilot:eve connected (10 times); {refused}",
        f"warning hub: pilot:eve connected (100 times); {refused}",
        "info hub: pilot:ann connected",
        "info hub: pilot:ann left",
    ]


# What systemd is told, through a real socket.


S = 1_000_000_000  # [ns]


class Manager:
    """The end of the socket that is systemd's."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.bind(address)

    def heard(self) -> list[str]:
        """Since the last call."""
        lines: list[str] = []
        while True:
            try:
                lines.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return lines


@contextmanager
def manager(address: str) -> Generator[Manager]:
    made = Manager(address)
    try:
        yield made
    finally:
        made.socket.close()


@pytest.mark.parametrize("abstract", [False, True])
def test_start_work_and_end_are_told(tmp_path: Path, abstract: bool):
    name = f"@lindy-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with manager(name.replace("@", "\0", 1) if abstract else name) as hears:
        systemd = Systemd({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "2000000"}, os.getpid())
        systemd.ready()
        systemd.works(1 * S)
        systemd.stopping()
        assert hears.heard() == ["READY=1", "WATCHDOG=1", "STOPPING=1"]


@given(
    st.integers(1, 60_000_000),
    st.lists(st.integers(0, 2 * S), min_size=1, max_size=200),
)
def test_the_watchdog_hears_twice_in_its_time_at_least_and_not_at_every_call(
    tmp_path_factory: pytest.TempPathFactory, period_us: int, pauses: list[int]
):
    name = str(tmp_path_factory.mktemp("systemd") / "notify")
    told = list[int]()
    with manager(name) as hears:
        systemd = Systemd({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": str(period_us)}, 1)
        now = 0
        for pause in pauses:
            now += pause
            before = told[-1] if told else None
            systemd.works(now)
            if hears.heard():
                told.append(now)
                assert before is None or now - before >= period_us * 500
            else:
                assert before is not None
                assert now - before < period_us * 500
    assert told[0] == pauses[0]


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"NOTIFY_SOCKET": "{name}"},
        {"NOTIFY_SOCKET": "{name}", "WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"},
        {"NOTIFY_SOCKET": "{name}", "WATCHDOG_USEC": "soon"},
        {"NOTIFY_SOCKET": "{name}-that-is-not-there", "WATCHDOG_USEC": "1000"},
        {"WATCHDOG_USEC": "1000"},
    ],
)
def test_without_watchdog_or_systemd_nothing_is_told(tmp_path: Path, environment: dict[str, str]):
    name = str(tmp_path / "notify")
    with manager(name) as hears:
        systemd = Systemd({key: value.format(name=name) for key, value in environment.items()}, 77)
        systemd.works(1 * S)
        systemd.stopping()
        assert "WATCHDOG=1" not in hears.heard()


def test_a_manager_that_reads_nothing_holds_nobody_up(tmp_path: Path):
    with manager(str(tmp_path / "notify")):
        systemd = Systemd({"NOTIFY_SOCKET": str(tmp_path / "notify")}, 1)
        for _ in range(10_000):  # far more than the socket takes; would wait for ever
            systemd.ready()


def test_a_disk_that_has_become_read_only_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[str]()
    note = RunNote(
        ProcessPlan(Dive(Stack(out=str(tmp_path)), Registry.read()), tmp_path), said.append
    )
    note.update({"control": 7}, 0)
    until(lambda: (tmp_path / RUNNING).exists())

    def refuse(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    with monkeypatch.context() as patched:
        for change in ("open", "replace", "unlink"):
            patched.setattr(Path, change, refuse)
        until(lambda: note.update({"control": 8}, 1) or said)
        note.remove()
    assert said == [f"cannot write {tmp_path / RUNNING}: read-only file system"]
