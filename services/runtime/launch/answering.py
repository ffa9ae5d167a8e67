"""Which processes run but do not answer: they hang, or were stopped.

Pure: who is heard, the state of each child and `now` are arguments. A process that has ended is the
business of `lifecycle.py`; this is about one that has not, and whose liveliness token disappeared.
On a busy computer that also happens, for some seconds, to processes that work.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from services.runtime.launch.lifecycle import Life

STILL_S = 2.0  # [s] without a token and without having run at all
UNHEARD_S = 15.0  # [s] without a token, whatever it does


@dataclass(frozen=True, slots=True)
class Silence:
    """Of a process that was heard before in the same life."""

    since: int  # [ns]
    ran: int | None  # [ns] processor time it had used when that last changed
    still_since: int  # [ns] … and when that was

    def seen(self, ran: int | None, now: int) -> "Silence":
        return self if ran == self.ran else replace(self, ran=ran, still_since=now)

    def hangs(self, now: int) -> bool:
        still = self.ran is not None and now - self.still_since >= STILL_S * 1e9
        return still or now - self.since >= UNHEARD_S * 1e9


@dataclass(slots=True)
class Answering:
    """Call `look` about ten times a second."""

    times: Counter[str] = field(default_factory=Counter[str])  # each was found not to answer
    silent: dict[str, None] = field(default_factory=dict[str, None])  # ordered set: those that hang
    _answered: dict[str, int] = field(default_factory=dict[str, int])  # in which of its lives
    _silences: dict[str, Silence] = field(default_factory=dict[str, Silence])

    def look(
        self, unheard: Mapping[str, int | None], lives: Mapping[str, Life], now: int
    ) -> list[tuple[str, bool]]:
        """What has changed: (name, does it answer again?).

        Args:
            unheard: processes without a liveliness token at `now` [ns], and the processor time [ns]
                that each has used; None: not known.
        """
        changes: list[tuple[str, bool]] = []
        for name, life in lives.items():
            if name not in unheard:
                if name in self.silent:
                    changes.append((name, True))
                self._answered[name] = life.lives
                self._forget(name)
            elif life.phase != "running" or self._answered.get(name) != life.lives:
                self._forget(name)  # it has ended, or has only just been started
            elif self._hangs(name, unheard[name], now) and name not in self.silent:
                changes.append((name, False))
                self.times[name] += 1
                self.silent[name] = None
        return changes

    def _hangs(self, name: str, ran: int | None, now: int) -> bool:
        before = self._silences.get(name) or Silence(now, ran, now)
        self._silences[name] = before.seen(ran, now)
        return self._silences[name].hangs(now)

    def _forget(self, name: str) -> None:
        self._silences.pop(name, None)
        self.silent.pop(name, None)
