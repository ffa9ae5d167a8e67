"""Does an instrument answer? Said once when it does and when it does not, and counted."""

from dataclasses import dataclass

from messages import events
from messages.events import Outbox
from messages.units import Ns

S = 1_000_000_000  # [ns]
AGAIN_NS = 5 * S  # [ns] of silence after which the connection is made anew, and again
GARBLED = "what arrives cannot be read: is it this instrument, and this speed of the cable?"


@dataclass(slots=True)
class InstrumentWatch:
    """Fed with what arrives; asked now and then."""

    name: str  # in health and log: `dvl`
    outbox: Outbox
    silent_ns: Ns = 3 * S  # [ns] without a report
    answers: bool = False
    _since: Ns | None = None  # of the newest report, or since when it is waited for
    _again: Ns = 0  # when the connection is made anew
    _garbled: int = 0  # arrivals since then that could not be read
    _said: bool = False

    def reported(self, now: Ns) -> bool:
        """A report was read. True: the first one after a silence."""
        first, self.answers = not self.answers, True
        self._since, self._said, self._garbled = now, False, 0
        if first:
            self.outbox.tell(events.ANSWERING(self.name))
        return first

    def garbled(self, times: int = 1) -> None:
        """Something arrived that is no report."""
        self.outbox.tell(events.MALFORMED(self.name), times)
        self._garbled += times

    def gives_up(self, now: Ns, trouble: str = "") -> bool:
        """Is the connection to be made anew? To be asked several times a second.

        Args:
            trouble: why the connection failed, for people; empty: not known.
        """
        if self._since is None:
            self._since = now
        if now - self._since < self.silent_ns:
            self._again = now + AGAIN_NS
            return False
        self.answers = False
        if not self._said:
            why = trouble or (GARBLED if self._garbled else "")
            self.outbox.tell(events.SILENT_INSTRUMENT(self.name, detail=why))
            self._said = True
        if now < self._again:
            return False
        self._again = now + AGAIN_NS
        return True
