"""Which processes run but do not answer: they hang, or were stopped.

Pure: who is heard, the state of each child and `now` are arguments. A process that has ended is the
business of `lifecycle.py`; this is about one that has not, and whose liveliness token disappeared.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from services.runtime.launch.lifecycle import Life

PATIENCE_S = 2.0  # [s] within which an end is noticed, or a busy computer connects a service again


@dataclass(slots=True)
class Answering:
    """Call `look` about ten times a second."""

    times: Counter[str] = field(default_factory=Counter[str])  # each was found not to answer
    silent: dict[str, None] = field(default_factory=dict[str, None])  # ordered set: those that hang
    _answered: dict[str, int] = field(default_factory=dict[str, int])  # in which of its lives
    _since: dict[str, int] = field(default_factory=dict[str, int])  # [ns] not heard

    def look(
        self, unheard: Collection[str], lives: Mapping[str, Life], now: int
    ) -> list[tuple[str, bool]]:
        """What has changed: (name, does it answer again?).

        Args:
            unheard: processes without a liveliness token at `now` [ns].
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
            elif now - self._since.setdefault(name, now) >= PATIENCE_S * 1e9:
                if name not in self.silent:
                    changes.append((name, False))
                    self.times[name] += 1
                self.silent[name] = None
        return changes

    def _forget(self, name: str) -> None:
        self._since.pop(name, None)
        self.silent.pop(name, None)
