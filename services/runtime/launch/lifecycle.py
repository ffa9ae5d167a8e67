"""When a child process is started, restarted or given up.

Pure: the event and `now` are arguments, the action is returned. A service that ends with status 1
before it was ever alive reports a wrong setting; starting it again would not help. Every other
unexpected end is a crash: the service is started again without the pilot having to do anything,
after a pause that grows with each crash in a row.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

BACK_OFF_S = (0.0, 0.5, 1.0, 2.0, 4.0)  # [s] before each restart in a row; the last one repeats
STEADY_S = 10.0  # [s] after running this long the back-off starts again from the shortest pause
MISTAKE = 1  # exit status for a wrong setting, with one sentence on stderr

Phase = Literal["waiting", "running", "stopping", "ended", "failed"]


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
