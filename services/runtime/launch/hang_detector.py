"""Which processes run but do not answer: they hang, or were stopped.

Pure: the heartbeats, the state of each child and `now` are arguments. A process that has ended is
the business of `lifecycle.py`; this is about one that has not, and whose loop does not go round.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from services.runtime.launch.lifecycle import Life

SILENT_S = 1.0  # [s] without a heartbeat, which comes ten times a second at least
STUCK_S = 0.3  # [s] the same, of one that does not even wait for a processor: it is not just late
HEARD_S = 5.0  # [s] in which everybody is heard who lives, which is once a second
STARTING_S = 12.0  # [s] longer than a service waits for its hub
PUNCTUAL_S = 0.25  # [s] between two looks: the time in between was there for everybody
LATE_S = 0.5  # [s] between two looks: the whole computer was busy or asleep, not one process


def is_unheard(life: Life, own: Collection[int], beside: Collection[int]) -> bool:
    """A process that was started again where there was no memory may go round and be heard by
    nobody, because its link or its hub lacks a thread, while others of its side are heard.

    Args:
        own: [ns] when each of its services was heard last.
        beside: [ns] the same, of the services of its side.
    """
    since_start = max(beside, default=0) - life.at
    return bool(life.restarts and own) and min(own) < life.at and since_start > HEARD_S * 1e9


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
    _given_up: dict[str, int] = field(default_factory=dict[str, int])  # lives that never began

    def look(
        self,
        beats: Mapping[str, int | None],
        lives: Mapping[str, Life],
        now: int,
        stuck: Callable[[str], bool] = lambda _: False,
        idle: Callable[[str], bool] = lambda _: False,
    ) -> list[SilenceChange]:
        """What has changed.

        Args:
            beats: [ns] newest heartbeat of each process; None: it has none yet.
            stuck: does it do nothing now, nor wait for a processor or a disk, and is not to be
                waited for? Asked of those that are silent.
            idle: does it do nothing now? Asked of those that take long to begin.
        """
        punctual = self._looked is not None and now - self._looked <= PUNCTUAL_S * 1e9
        if self._looked is None or now - self._looked > LATE_S * 1e9:
            self._since = now
        self._looked = now
        changes: list[SilenceChange] = []
        for name, life in lives.items():
            beat = beats.get(name)
            if self.silent.get(name, life.lives) != life.lives:
                self._forget(name)  # it was started again meanwhile
            if life.phase != "running" or beat is None or beat < life.at:
                self._forget(name)  # it has ended, or has not begun
                waits = life.phase == "running" and now - life.at > STARTING_S * 1e9
                if waits and life.lives > 1 and punctual and idle(name):
                    changes += self._never_begins(name, life.lives)
                continue
            silence_s = (now - max(beat, self._since)) / 1e9
            is_stuck = punctual and silence_s > STUCK_S and stuck(name)
            changes += self._judge(name, life.lives, silence_s, stuck=is_stuck)
        return changes

    def _never_begins(self, name: str, lives: int) -> list[SilenceChange]:
        """A process that was started again where there was no room for all its threads."""
        if self._given_up.get(name) == lives:
            return []
        self._given_up[name] = lives
        self.times[name] += 1
        return [SilenceChange(name, "silent"), SilenceChange(name, "hopeless")]

    def _judge(
        self, name: str, lives: int, silence_s: float, *, stuck: bool
    ) -> list[SilenceChange]:
        if silence_s <= (STUCK_S if name in self.silent else SILENT_S) and not stuck:
            was_silent = name in self.silent
            self._forget(name)
            return [SilenceChange(name, "again")] if was_silent else []
        changes: list[SilenceChange] = []
        if name not in self.silent:
            self.silent[name] = lives
            self.times[name] += 1
            changes.append(SilenceChange(name, "silent"))
        hopeless = stuck or silence_s > self.patience_s.get(name, SILENT_S)
        if hopeless and name not in self._hopeless:
            self._hopeless.add(name)
            changes.append(SilenceChange(name, "hopeless"))
        return changes

    def _forget(self, name: str) -> None:
        self.silent.pop(name, None)
        self._hopeless.discard(name)
