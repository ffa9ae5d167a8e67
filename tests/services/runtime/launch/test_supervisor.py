"""The supervisor with toy processes, and the log of each. A test waits for what must come."""

import errno
import os
import stat
import sys
import threading
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.launch import supervisor as module
from services.runtime.launch.child import Child, OsChild, Task
from services.runtime.launch.supervisor import (
    LATE_S,
    MISTAKE,
    PUNCTUAL_S,
    SILENT_S,
    STUCK_S,
    Action,
    Ended,
    HangDetector,
    Life,
    LifeEvent,
    Phase,
    SilenceChange,
    Supervisor,
    advance,
)
from tests.support.patience import until
from tests.support.started import exists

SLEEP = "import time\nprint('here', flush=True)\ntime.sleep(600)"
DEAF = "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n" + SLEEP
MISTAKEN = "import sys\nsys.exit('lindy toy: depth is 7, expected at most 3')"
BROKEN = "raise KeyError('x')"
PARENT = f"""
import subprocess, sys
toy = subprocess.Popen([sys.executable, "-c", {SLEEP!r}])
print(toy.pid, flush=True)
toy.wait()
"""


class Toys:
    """A supervisor, what it said, and how to add children to it."""

    def __init__(self, folder: Path) -> None:
        self.told: list[str] = []
        self.supervisor = Supervisor(lambda _, text: self.told.append(text))
        self._folder = folder

    def add(self, name: str, code: str, stop_order: int = 0) -> None:
        log = self._folder / f"{name}.log"
        self.supervisor.add([Task(name, [sys.executable, "-S", "-c", code], log, stop_order)])
        self.supervisor.step()

    def until(self, events: Callable[[], bool]) -> None:
        until(events, lambda: self.told, self.supervisor.step)

    def wrote(self, name: str) -> str:
        log = self._folder / f"{name}.log"
        return log.read_text() if log.exists() else ""

    def until_written(self, name: str) -> str:
        self.until(lambda: self.wrote(name).endswith("\n"))
        return self.wrote(name)


@pytest.fixture
def toys(tmp_path: Path) -> Generator[Toys]:
    toys = Toys(tmp_path)
    yield toys
    toys.supervisor.stop()


def test_what_is_not_needed_ends_nothing_when_it_cannot_start(toys: Toys, tmp_path: Path):
    command = [sys.executable, "-S", "-c", MISTAKEN]
    toys.supervisor.add([Task("toy", command, tmp_path / "toy.log", needed=False)])
    toys.add("other", SLEEP)
    toys.until(lambda: bool(toys.told))
    assert toys.told == ["depth is 7, expected at most 3; the dive goes on without toy"]
    assert toys.supervisor.failure is None
    assert list(toys.supervisor.pids) == ["other"]


def test_a_service_that_cannot_start_is_named_with_its_log(toys: Toys, tmp_path: Path):
    toys.add("toy", BROKEN)
    toys.until(lambda: toys.supervisor.failure is not None)
    assert toys.supervisor.failure == f"toy cannot start: KeyError: 'x' (see {tmp_path}/toy.log)"


def test_what_a_child_has_started_ends_with_it(toys: Toys):
    toys.add("parent", PARENT)

    def numbers() -> list[str]:  # both write to one file, and which is first is chance
        return [word for word in toys.wrote("parent").split() if word.isdigit()]

    toys.until(lambda: bool(numbers()))
    grandchild = int(numbers()[0])
    assert exists(grandchild)
    toys.supervisor.stop()
    toys.until(lambda: not exists(grandchild))


def test_a_child_that_is_deaf_is_killed_and_named(toys: Toys, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "PATIENCE_S", 0.3)
    toys.add("deaf", DEAF)
    toys.until_written("deaf")
    pid = toys.supervisor.pids["deaf"]
    toys.supervisor.stop()
    assert not exists(pid)
    assert toys.told == ["deaf did not end within 0.3 s and was killed"]


class PretendChild:
    """A process that ends when a test says so."""

    def __init__(self, running: list[str], order: list[str], name: str) -> None:
        assert name not in running, "two processes for one child"
        running.append(name)
        self.pid, self.unlogged = 0, ""
        self._running, self._order, self._name = running, order, name
        self._status: int | None = None

    def end(self, status: int) -> None:
        if self._status is None:
            self._running.remove(self._name)
            self._order.append(self._name)
            self._status = status

    def ended(self) -> int | None:
        return self._status

    def last_line(self) -> str:
        return ""

    def terminate(self) -> None:
        self.end(0)

    def kill(self) -> None:
        self.end(-9)


class Stage:
    """A supervisor over pretended children and a pretended clock."""

    def __init__(self) -> None:
        self.now = 0
        self.running: list[str] = []
        self.order: list[str] = []  # in which children ended
        self.children: dict[str, PretendChild] = {}
        self.supervisor = Supervisor(lambda _level, _text: None, self._spawn, lambda: self.now)
        self.supervisor.add(
            [
                Task("hub", [], Path(), stop_order=2),
                Task("recorder", [], Path(), stop_order=1),
                Task("control", [], Path()),
            ]
        )
        self.supervisor.step()

    def _spawn(self, task: Task) -> Child:
        self.children[task.name] = PretendChild(self.running, self.order, task.name)
        return self.children[task.name]


def test_the_recorder_ends_after_the_services_and_the_hub_after_the_recorder():
    stage = Stage()
    stage.supervisor.stop()
    assert stage.order == ["control", "recorder", "hub"]


def test_a_child_that_cannot_be_started_now_is_started_later():
    """A computer without free descriptors, processes or memory: for a while."""
    numbers, told, running = [errno.EMFILE, errno.EAGAIN, errno.ENOMEM], list[str](), list[str]()
    words, now = [os.strerror(number).lower() for number in numbers], 0

    def spawn(task: Task) -> Child:
        if numbers:
            raise OSError(number := numbers.pop(0), os.strerror(number))
        return PretendChild(running, [], task.name)

    supervisor = Supervisor(lambda _, text: told.append(text), spawn, lambda: now)
    supervisor.add([Task("toy", [], Path())])
    for _ in range(20):
        supervisor.step()
        now += 1_000_000_000
    whys = [f"toy could not be started: {why}; tried again" for why in words]
    again = "toy is started again"
    assert told == [whys[0], again, whys[1], again, whys[2], again]
    assert (running, supervisor.failure) == (["toy"], None)


NAMES = st.sampled_from(["hub", "recorder", "control"])
MOMENTS = st.lists(
    st.tuples(NAMES, st.sampled_from([None, 0, 1, -9]), st.integers(0, 3_000_000_000)), max_size=40
)


@settings(max_examples=100)
@given(MOMENTS)
def test_whatever_crashes_all_run_again_or_a_mistake_is_reported(
    moments: list[tuple[str, int | None, int]],
):
    stage = Stage()
    for name, status, pause in moments:
        if status is None:
            stage.supervisor.seen(name)
        else:
            stage.children[name].end(status)
        stage.now += pause
        stage.supervisor.step()
    stage.now += 4_000_000_000  # the longest back-off
    stage.supervisor.step()
    stage.now += 4_000_000_000
    stage.supervisor.step()
    failed = [name for name, life in stage.supervisor.lives.items() if life.phase == "failed"]
    assert sorted(stage.running + failed) == ["control", "hub", "recorder"]
    assert (stage.supervisor.failure is not None) == bool(failed)
    stage.supervisor.stop()
    assert stage.running == []


def test_a_child_whose_log_cannot_be_written_runs(toys: Toys, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    toys.supervisor.add([Task("toy", [sys.executable, "-S", "-c", SLEEP], tmp_path / "file/log")])
    warning = f"toy runs without a log: cannot write {tmp_path}/file/log: "
    toys.until(lambda: sum(text.startswith(warning) for text in toys.told) == 1)
    toys.supervisor.seen("toy")
    os.kill(toys.supervisor.pids["toy"], 9)
    toys.until(lambda: sum(text.startswith(warning) for text in toys.told) == 2)
    assert toys.supervisor.failure is None


# The log of a child, also on a disk that hangs or is full.


def printed(path: Path, text: str) -> OsChild:
    """By a process that has ended."""
    code = f"import sys; sys.stdout.write({text!r})"
    child = OsChild(Task("toy", [sys.executable, "-S", "-c", code], path))
    until(lambda: child.ended() is not None)
    return child


def test_what_several_processes_print_is_appended(tmp_path: Path) -> None:
    path = tmp_path / "logs" / "toy.log"
    for text, last in (("first\nof one\n", "of one"), ("of another\n\n", "of another"), ("", "")):
        child = printed(path, text)
        until(lambda child=child, last=last: child.last_line() == last)
        assert child.unlogged == ""
    assert path.read_text() == "first\nof one\nof another\n\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_whoever_prints_goes_on_while_the_disk_hangs(tmp_path: Path) -> None:
    path = tmp_path / "toy.log"
    os.mkfifo(path)  # whoever opens it to write waits for a reader
    child = printed(path, "printed\n")
    assert child.last_line() == ""
    reader = os.open(path, os.O_RDONLY)
    until(lambda: child.last_line() == "printed")
    assert os.read(reader, 1000) == b"printed\n"
    os.close(reader)


def test_of_a_log_on_a_full_disk_the_last_line_is_known_and_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class NearlyFull:
        def write(self, data: bytes) -> int:
            if path.stat().st_size >= 4:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return path.write_bytes(data[:4])

        def close(self) -> None: ...

    path, opened = tmp_path / "toy.log", cast(Any, os.fdopen)

    def nearly_full(file: int, *how: Any) -> Any:
        if how[0] != "ab":
            return opened(file, *how)
        os.close(file)
        return NearlyFull()

    monkeypatch.setattr(os, "fdopen", nearly_full)
    child = printed(path, "whole line\n")
    until(lambda: child.last_line() == "whole line")
    assert path.read_bytes() == b"whol"
    assert child.unlogged == f"cannot write {path}: the disk is full"


def test_a_computer_without_room_for_a_thread_starts_a_child_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(OSError, match="no room for another thread"):
        printed(tmp_path / "toy.log", "")


# The laws of a child's life, whatever happens in whatever order; and who does not answer.


PAUSES = st.integers(0, 20_000_000_000)  # [ns] between two events
EVENTS = st.one_of(
    st.sampled_from(LifeEvent), st.builds(Ended, st.sampled_from([0, MISTAKE, 2, -9, -15]))
)
STORIES = st.lists(st.tuples(PAUSES, EVENTS), max_size=60)


def seconds(value: float) -> int:
    return round(value * 1e9)


def after(life: Life, *events: LifeEvent | Ended, now: int = 0) -> Life:
    for event in events:
        life, _ = advance(life, event, now)
    return life


@settings(max_examples=200)
@given(STORIES)
def test_there_are_never_two_processes_for_one_child(story: list[tuple[int, LifeEvent | Ended]]):
    life, now, processes, done = Life(), 0, 0, False
    for pause, event in story:
        now += pause
        if isinstance(event, Ended):
            if processes == 0:
                continue  # what does not run cannot end
            processes -= 1
        life, action = advance(life, event, now)
        processes += action is Action.START
        assert processes == (life.phase in ("running", "stopping"))
        assert processes <= 1
        assert not (done and action is Action.START)
        done = done or event is LifeEvent.STOP or life.phase == "failed"


def test_the_back_off_grows_with_each_crash_in_a_row_until_a_steady_life():
    life, pauses = after(Life(), LifeEvent.TICK, LifeEvent.SEEN), list[float]()
    for _ in range(7):
        crashed_at = life.at
        life = after(life, Ended(-11), now=crashed_at)
        pauses.append((life.at - crashed_at) / 1e9)
        assert after(life, LifeEvent.TICK, now=life.at - 1).phase == "waiting"
        life = after(life, LifeEvent.TICK, now=life.at)
    assert pauses == [0.0, 0.5, 1.0, 2.0, 4.0, 4.0, 4.0]
    assert life.restarts == 7
    steady = life.at + seconds(10.0)
    assert after(life, Ended(-9), now=steady).at == steady
    assert after(life, Ended(-9), now=steady - 1).at == steady - 1 + seconds(4.0)


def test_status_1_before_it_was_ever_alive_is_the_users_mistake():
    _, action = advance(after(Life(), LifeEvent.TICK), Ended(MISTAKE), 1)
    assert action is Action.GIVE_UP


@pytest.mark.parametrize(("seen", "status"), [(False, 0), (True, 0), (True, MISTAKE)])
def test_an_end_that_nobody_asked_for_is_a_crash(seen: bool, status: int):
    life = after(Life(seen=seen), LifeEvent.TICK)
    life, action = advance(life, Ended(status), 1)
    assert (life.phase, life.crashes, action) == ("waiting", 1, None)


def test_a_child_that_waits_for_its_restart_ends_at_once_when_it_is_no_longer_wanted():
    life = after(Life(), LifeEvent.TICK, LifeEvent.SEEN, Ended(-9), LifeEvent.STOP)
    assert after(life, LifeEvent.TICK, now=seconds(60)).phase == "ended"


# A process that runs without answering is named, once each time, and no other one is.


STEP_NS = 100_000_000  # [ns] between two looks
LONG_S = 3.0
PHASES: tuple[Phase, ...] = ("waiting", "running", "stopping", "ended")
SILENCES = st.lists(
    st.tuples(
        st.booleans(), st.sampled_from(PHASES), st.booleans(), st.booleans(), st.integers(1, 60)
    ),
    max_size=10,
)  # does its loop go round, in which phase, was it started again, is it stuck, for how many looks


@settings(max_examples=300)
@given(SILENCES, st.sampled_from([SILENT_S, LONG_S]))
def test_only_a_life_that_has_beaten_and_then_stopped_is_named(
    story: list[tuple[bool, Phase, bool, bool, int]], patience_s: float
) -> None:
    answering = HangDetector({"control": patience_s})
    now, life, beat, named, given_up = 0, Life(lives=1), None, False, False
    for beats, phase, again, is_stuck, looks in story:
        named, given_up = named and not again, given_up and not again
        life = Life(phase=phase, lives=life.lives + again, at=now if again else life.at)
        for _ in range(looks):
            now += STEP_NS
            beat = now if beats else beat
            changes = answering.look({"control": beat}, {"control": life}, now, lambda _: is_stuck)  # noqa: B023
            judged = phase == "running" and beat is not None and beat >= life.at
            silence_s = 0.0 if beat is None else (now - max(beat, STEP_NS)) / 1e9
            stuck = judged and is_stuck and silence_s > STUCK_S
            silent = stuck or (judged and silence_s > (STUCK_S if named else SILENT_S))
            hopeless = stuck or (judged and silence_s > max(SILENT_S, patience_s))
            expected = [
                *([SilenceChange("control", "silent")] if silent and not named else []),
                *([SilenceChange("control", "hopeless")] if hopeless and not given_up else []),
                *([SilenceChange("control", "again")] if judged and named and not silent else []),
            ]
            assert changes == expected
            assert ("control" in answering.silent) == silent
            named, given_up = silent, silent and (hopeless or given_up)


def test_a_computer_that_was_asleep_is_nobodys_fault() -> None:
    answering, life = HangDetector(), {"control": Life(phase="running", lives=1)}
    assert answering.look({"control": 0}, life, 0) == []
    asleep = round((LATE_S + 100.0) * 1e9)
    assert answering.look({"control": 0}, life, asleep) == []
    soon = asleep + round(0.9 * SILENT_S * 1e9)
    for now in range(asleep, soon, STEP_NS):
        assert answering.look({"control": 0}, life, now) == []
    late = [
        change
        for now in range(soon, soon + 2 * STEP_NS, STEP_NS // 2)
        for change in answering.look({"control": 0}, life, now)
    ]
    assert [change.what for change in late] == ["silent", "hopeless"]


def test_who_is_stuck_is_not_waited_for_but_by_a_supervisor_that_is_late_itself() -> None:
    """After a pause of the whole computer a process had no time to beat."""
    for gap_s, what in [(PUNCTUAL_S, ["silent", "hopeless"]), (1.1 * PUNCTUAL_S, list[str]())]:
        answering, life = HangDetector(), {"tether": Life(phase="running", lives=1)}
        before = round(0.9 * STUCK_S * 1e9)
        assert answering.look({"tether": 0}, life, before - STEP_NS, lambda _: True) == []
        assert answering.look({"tether": 0}, life, before, lambda _: True) == []
        late = before + round(gap_s * 1e9)
        changes = answering.look({"tether": 0}, life, late, lambda _: True)
        assert [change.what for change in changes] == what
