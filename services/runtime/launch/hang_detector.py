"""Which processes run but do not answer: they hang, or were stopped.

Pure: the heartbeats, the state of each child and `now` are arguments. A process that has ended is
the business of `supervisor.py`; this is about one that has not, and whose loop does not go round.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from services.runtime.launch.supervisor import Life

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
            beat = beats.get(name)
            if self.silent.get(name, life.lives) != life.lives:
                self._forget(name)  # it was started again meanwhile
            if life.phase != "running" or beat is None or beat < life.at:
                self._forget(name)  # it has ended, or has not begun
                continue
            silence_s = (now - max(beat, self._since)) / 1e9
            is_stuck = punctual and silence_s > STUCK_S and stuck(name)
            changes += self._judge(name, life.lives, silence_s, stuck=is_stuck)
        return changes

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
