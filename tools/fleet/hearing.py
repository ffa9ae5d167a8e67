"""How well one drone is heard, from the numbers of what it says. Pure."""

from dataclasses import dataclass

from messages.units import Ns

SPAN: Ns = 10_000_000_000  # of one count; the share is of the last one or two
MOST_MISSED = 10_000  # of a longer jump nobody knows whether the service has started again


@dataclass(slots=True)
class _Count:
    got: int = 0
    missed: int = 0


class Hearing:
    """Of one stream, whose messages are numbered."""

    def __init__(self) -> None:
        self.heard_ns: Ns = 0  # when the newest came
        self._seq: int | None = None
        self._older, self._newer = _Count(), _Count()
        self._since: Ns = 0

    def hear(self, seq: int, now: Ns) -> None:
        """A message came."""
        self._turn(now)
        step = 1 if self._seq is None else seq - self._seq
        if 1 < step <= MOST_MISSED:
            self._newer.missed += step - 1
        self._newer.got += 1
        self._seq, self.heard_ns = seq, now

    def loss(self, now: Ns) -> float | None:
        """[-] Share of what was said lately that did not come; None: nothing came lately."""
        self._turn(now)
        got = self._older.got + self._newer.got
        missed = self._older.missed + self._newer.missed
        return missed / (got + missed) if got else None

    def _turn(self, now: Ns) -> None:
        """Begin another count when the present one has its time."""
        if now - self._since < SPAN:
            return
        self._older = self._newer if now - self._since < 2 * SPAN else _Count()
        self._newer, self._since = _Count(), now
