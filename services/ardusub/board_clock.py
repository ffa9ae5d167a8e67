"""The board's clock against ours, with a bound.

The board stamps with the time since its boot. An answer to TIMESYNC was stamped after the question
was sent and before the answer arrived, and any message was stamped before it arrived: each bounds
the offset, and it lies within all bounds (Marzullo and Owicki 1983). Crystals differ, so a bound
widens with its age. Where bounds contradict each other, the clock was shifted, and the newest bound
holds: the clock of ArduSub's own simulator stands still and catches up whenever its computer is
busy. By more, or where the board's time runs backwards, the clock jumped.
"""

from dataclasses import dataclass
from math import inf

from messages.units import Ns

DRIFT = 100e-6  # [-] greatest difference of two crystals
ROUNDING_NS = 2_000_000  # [ns] contradictions up to this come from stamps in whole milliseconds
SHIFT_NS = 1_000_000_000  # [ns] contradictions beyond this are of a board that was started anew
BACKWARDS_NS = 500_000_000  # [ns] messages are out of order by far less


@dataclass(slots=True)
class BoardClock:
    """Offset = our clock - board's clock [ns]."""

    jumps: int = 0
    went_back: bool = False  # at the newest jump: as a restart of the board does
    shifts: int = 0
    _least: float = -inf
    _most: float = inf
    _as_of: Ns | None = None  # of our clock, when the bounds were widened last
    _newest: Ns | None = None  # of the board's clock

    @property
    def known(self) -> bool:
        return self._least > -inf and self._most < inf

    @property
    def bound_ns(self) -> float:
        """[ns] Largest error of `ours`."""
        return (self._most - self._least) / 2

    def heard(self, board: Ns, arrival: Ns) -> bool:
        """A message stamped at `board` [ns] arrived. False: the clock has jumped since."""
        return self._bounded(board, arrival, -inf, arrival - board)

    def answered(self, sent: Ns, board: Ns, arrival: Ns) -> bool:
        """An answer to a question that was sent at `sent` [ns]. False: the clock has jumped."""
        return self._bounded(board, arrival, sent - board, arrival - board)

    def ours(self, board: Ns, now: Ns) -> Ns | None:
        """[ns] Of our clock, never after now; None while the offset is not known."""
        if not self.known:
            return None
        return min(now, board + round((self._least + self._most) / 2))

    def forget(self) -> None:
        self._least, self._most, self._as_of, self._newest = -inf, inf, None, None

    def _bounded(self, board: Ns, now: Ns, least: float, most: float) -> bool:
        self._widen(now)
        backwards = self._newest is not None and board < self._newest - BACKWARDS_NS
        gap = max(self._least - most, least - self._most)  # [ns] between old and new bounds
        jumped = backwards or gap > SHIFT_NS
        if jumped:
            self.jumps += 1
            self.went_back = backwards or least > self._most
            self.forget()
            self._as_of = now
        elif gap > 0:
            self._shift(least, most, gap)
        self._newest = board if self._newest is None else max(board, self._newest)
        self._least, self._most = max(self._least, least), min(self._most, most)
        return not jumped

    def _shift(self, least: float, most: float, gap: float) -> None:
        """Move the interval, as wide as it is, to where it agrees with the newest bound."""
        self.shifts += gap > ROUNDING_NS
        width = self._most - self._least
        if most < self._least:
            self._least, self._most = most - width, most
        else:
            self._least, self._most = least, least + width

    def _widen(self, now: Ns) -> None:
        if self._as_of is not None:
            wider = DRIFT * max(0, now - self._as_of)
            self._least, self._most = self._least - wider, self._most + wider
        self._as_of = now
