"""Keeps a set of processes running, and ends all of them.

`advance` decides, and is pure; `child.py` talks to the operating system; the supervisor carries out
the decisions, once per `step`. It knows nothing of services, hubs or Zenoh.

A service that ends with status 1 before it was ever alive reports a wrong setting; starting it
again would not help. Every other unexpected end is a crash: the service is started again without
the pilot having to do anything, after a pause that grows with each crash in a row.
"""

import signal
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Literal, NamedTuple

from services.runtime.config.disk import reason
from services.runtime.launch.child import Child, OsChild, Task

NAME = "supervisor"  # its name on the bus
PATIENCE_S = 5.0  # [s] between asking a process to end and killing it
NOT_STARTED = -1  # in the place of an exit status: a crash, after which it is started again
POLL_S = 0.02  # [s] between two checks while processes are stopping
BACK_OFF_S = (0.0, 0.5, 1.0, 2.0, 4.0)  # [s] before each restart in a row; the last one repeats
STEADY_S = 10.0  # [s] after running this long the back-off starts again from the shortest pause
MISTAKE = 1  # exit status for a wrong setting, with one sentence on stderr

Phase = Literal["waiting", "running", "stopping", "ended", "failed"]
Tell = Callable[[Literal["info", "warning", "error"], str], None]


class LifeEvent(Enum):
    """What can happen to a child besides its end."""

    TICK = "tick"  # time has passed
    SEEN = "seen"  # its liveliness token appeared on the bus
    STOP = "stop"  # it is to end


@dataclass(frozen=True, slots=True)
class Ended:
    """The process has ended. `status` is its exit status, or minus the signal that ended it."""

    status: int


class Action(Enum):
    """What the supervisor must do."""

    START = "start"
    TERMINATE = "terminate"
    GIVE_UP = "give up"  # stop everything and show the user this child's last line


@dataclass(frozen=True, slots=True)
class Life:
    """State of a child."""

    phase: Phase = "waiting"
    at: int = 0  # [ns] waiting: when to start it; otherwise when it was started
    lives: int = 0  # times it was started
    seen: bool = False  # it was alive once
    crashes: int = 0  # in a row, without `STEADY_S` of running in between

    @property
    def restarts(self) -> int:
        return max(0, self.lives - 1)


def advance(life: Life, event: LifeEvent | Ended, now: int) -> tuple[Life, Action | None]:
    """The child's next state at `now` [ns], and what to do about it."""
    if isinstance(event, Ended):
        return _after_end(life, event.status, now)
    if event is LifeEvent.SEEN:
        return replace(life, seen=True), None
    if event is LifeEvent.STOP:
        return _unwanted(life)
    if life.phase == "waiting" and now >= life.at:
        return replace(life, phase="running", at=now, lives=life.lives + 1), Action.START
    return life, None


def _unwanted(life: Life) -> tuple[Life, Action | None]:
    if life.phase == "running":
        return replace(life, phase="stopping"), Action.TERMINATE
    if life.phase == "waiting":
        return replace(life, phase="ended"), None
    return life, None


def _after_end(life: Life, status: int, now: int) -> tuple[Life, Action | None]:
    if life.phase == "stopping":
        return replace(life, phase="ended"), None
    if life.phase != "running":
        return life, None
    if status == MISTAKE and not life.seen:
        return replace(life, phase="failed"), Action.GIVE_UP
    crashes = 1 if now - life.at >= STEADY_S * 1e9 else life.crashes + 1
    pause_s = BACK_OFF_S[min(crashes, len(BACK_OFF_S)) - 1]
    again = now + round(pause_s * 1e9)
    return replace(life, phase="waiting", at=again, crashes=crashes), None


class Supervisor:
    """Call `step` at least ten times a second, and `stop` at the end, whatever happened."""

    def __init__(
        self,
        tell: Tell,
        spawn: Callable[[Task], Child] = OsChild,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.lives: dict[str, Life] = {}
        self.failure: str | None = None  # why everything must stop: the last line of a child
        self._tasks: dict[str, Task] = {}
        self._children: dict[str, Child] = {}
        self._unlogged: set[int] = set()  # processes of which it was said
        self._tell = tell
        self._spawn = spawn
        self._clock = clock

    def add(self, tasks: Iterable[Task]) -> None:
        """Start these at the next step."""
        for task in tasks:
            self._tasks[task.name] = task
            self.lives[task.name] = Life(at=self._clock())

    def seen(self, name: str) -> None:
        """A child's liveliness token appeared."""
        self._handle(name, LifeEvent.SEEN)

    @property
    def restarts(self) -> dict[str, int]:
        return {name: life.restarts for name, life in self.lives.items()}

    @property
    def pids(self) -> dict[str, int]:
        """Process ids of the children that run now."""
        return {name: child.pid for name, child in self._children.items()}

    def kill(self, name: str) -> None:
        """End a child that does not answer; it is started again like one that has crashed."""
        if (child := self._children.get(name)) is not None:
            child.kill()

    def step(self) -> None:
        """Check every child once and do what is due."""
        for name, child in list(self._children.items()):
            if child.unlogged and child.pid not in self._unlogged:
                self._unlogged.add(child.pid)
                self._tell("warning", f"{name} runs without a log: {child.unlogged}")
            if (status := child.ended()) is not None:
                self._ended(name, status)
        for name in self.lives:
            self._handle(name, LifeEvent.TICK)

    def stop(self) -> None:
        """End all children, in their stop order. Returns when none is left."""
        for stop_order in sorted({task.stop_order for task in self._tasks.values()}):
            names = [name for name, task in self._tasks.items() if task.stop_order == stop_order]
            for name in names:
                self._handle(name, LifeEvent.STOP)
            self._wait_for(names)

    def _wait_for(self, names: list[str]) -> None:
        deadline = self._clock() + round(PATIENCE_S * 1e9)
        while self._clock() < deadline:
            self.step()
            if not any(name in self._children for name in names):
                return
            time.sleep(POLL_S)  # an ending process announces nothing
        for name in names:
            if (child := self._children.get(name)) is not None:
                who = self._tasks[name].in_words
                self._tell("warning", f"{who} did not end within {PATIENCE_S:g} s and was killed")
                child.kill()
        self.step()

    def _handle(self, name: str, event: LifeEvent | Ended) -> None:
        if name not in self.lives:
            return  # a token of a process that is not ours
        self.lives[name], action = advance(self.lives[name], event, self._clock())
        if action is Action.START:
            if self.lives[name].restarts:
                self._tell("warning", f"{self._tasks[name].in_words} is started again")
            self._start(name)
        elif action is Action.TERMINATE:
            self._children[name].terminate()

    def _start(self, name: str) -> None:
        try:
            self._children[name] = self._spawn(self._tasks[name])
        except OSError as error:  # no descriptors, no room for a process: now
            self.lives[name], _ = advance(self.lives[name], Ended(NOT_STARTED), self._clock())
            who = self._tasks[name].in_words
            self._tell("error", f"{who} could not be started: {reason(error)}; tried again")

    def _ended(self, name: str, status: int) -> None:
        words = self._children.pop(name).last_line()
        self._handle(name, Ended(status))
        phase, task, said = self.lives[name].phase, self._tasks[name], own_sentence(name, words)
        if phase == "failed":
            printed = words or "it printed nothing"
            sentence = said or f"{name} cannot start: {printed} (see {task.log})"
            if not task.needed:
                self._tell("error", f"{sentence}; the dive goes on without {name}")
            elif self.failure is None:
                self.failure = sentence
        elif phase == "waiting":
            why = how(status) if said is None else f"{how(status)}: {said}"
            self._tell("error", f"{task.in_words} ended unexpectedly ({why})")


def how(status: int) -> str:
    """How a process ended: `status 3`, or `signal SIGKILL`."""
    if status >= 0:
        return f"status {status}"
    try:
        return f"signal {signal.Signals(-status).name}"
    except ValueError:
        return f"signal {-status}"


def own_sentence(name: str, words: str) -> str | None:
    """What a child that prints `lindy <name>: …` says itself; None where it prints no such line."""
    for prefix in (f"lindy {name}: ", f"lindy {name.partition('_')[0]}: "):  # hub_drone is a hub
        if words.startswith(prefix):
            return words.removeprefix(prefix)
    return None


SILENT_S = 1.0  # [s] without a heartbeat, which comes ten times a second at least
STUCK_S = 0.3  # [s] the same, of one that does not even wait for a processor: it is not just late
PUNCTUAL_S = 0.25  # [s] between two looks: the time in between was there for everybody
LATE_S = 0.5  # [s] between two looks: the whole computer was busy or asleep, not one process


class SilenceChange(NamedTuple):
    """Of a process, since the last look."""

    name: str
    what: str  # `silent`, `again`, or `hopeless`: silent for longer than anybody should wait


@dataclass(slots=True)
class HangDetector:
    """Call `look` about ten times a second."""

    patience_s: Mapping[str, float] = field(default_factory=dict[str, float])  # [s] until hopeless
    times: Counter[str] = field(default_factory=Counter[str])  # each was found not to answer
    silent: dict[str, int] = field(default_factory=dict[str, int])  # those that hang; their lives
    _looked: int | None = None  # [ns] last look
    _since: int = 0  # [ns] before this nothing is held against anybody
    _hopeless: set[str] = field(default_factory=set[str])

    def look(
        self,
        beats: Mapping[str, int | None],
        lives: Mapping[str, Life],
        now: int,
        stuck: Callable[[str], bool] = lambda _: False,
    ) -> list[SilenceChange]:
        """What has changed.

        Args:
            beats: [ns] newest heartbeat of each process; None: it has none yet.
            stuck: does it do nothing now, nor wait for a processor or a disk, and is not to be
                waited for? Asked of those that are silent.
        """
        punctual = self._looked is not None and now - self._looked <= PUNCTUAL_S * 1e9
        if self._looked is None or now - self._looked > LATE_S * 1e9:
            self._since = now
        self._looked = now
        changes: list[SilenceChange] = []
        for name, life in lives.items():
            newest = beats.get(name)
            beat = -1 if newest is None else newest
            known = self.silent.get(name) == life.lives  # else it was started again meanwhile
            begun = life.phase == "running" and beat >= life.at
            silence_s = (now - max(beat, self._since)) / 1e9 if begun else 0.0
            is_stuck = punctual and silence_s > STUCK_S and stuck(name)
            if not is_stuck and silence_s <= (STUCK_S if known else SILENT_S):
                changes += [SilenceChange(name, "again")] if known and begun else []
                self.silent.pop(name, None)
                self._hopeless.discard(name)
                continue
            if not known:
                self.silent[name] = life.lives
                self.times[name] += 1
                self._hopeless.discard(name)
                changes.append(SilenceChange(name, "silent"))
            patience_s = self.patience_s.get(name, SILENT_S)
            if name not in self._hopeless and (is_stuck or silence_s > patience_s):
                self._hopeless.add(name)
                changes.append(SilenceChange(name, "hopeless"))
        return changes
