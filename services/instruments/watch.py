"""Does an instrument answer, and does it measure? Said once when it begins and when it ends."""

from dataclasses import dataclass

from messages import events
from messages.events import Event, Outbox
from messages.units import Ns

S = 1_000_000_000  # [ns]
AGAIN_NS = 5 * S  # [ns] of silence after which the connection is made anew, and again
EMPTY_NS = 3 * S  # [ns] of reports without a measurement that are worth a sentence
OTHER_NS = 3 * S  # [ns] for which another instrument's measurement counts
GARBLED = "what arrives cannot be read: is it this instrument, and this speed of the cable?"


@dataclass(slots=True)
class InstrumentWatch:
    """Fed with what arrives; asked now and then."""

    name: str  # in health and log: `dvl`
    outbox: Outbox
    silent_ns: Ns = 3 * S  # [ns] without a report
    only_asks: bool = False  # as of `lindy doctor`: nothing is set up
    answers: bool = False
    _since: Ns | None = None  # of the newest report, or since when it is waited for
    _again: Ns = 0  # when the connection is made anew
    _garbled: int = 0  # arrivals since then that could not be read
    _said: bool = False
    _empty_ns: Ns | None = None  # since when it measures nothing
    _said_empty: bool = False

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

    def measured(self) -> None:
        """A report had a measurement in it."""
        self._empty_ns, self._said_empty = None, False

    def measured_nothing(self, now: Ns, event: Event) -> None:
        """A report had none in it; what that is called is told once it lasts."""
        if self._empty_ns is None:
            self._empty_ns = now
        if not self._said_empty and now - self._empty_ns >= EMPTY_NS:
            self._said_empty = True
            self.outbox.tell(event)

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


@dataclass(slots=True)
class FirstOfTwo:
    """Where two instruments measure the same, who came first goes on. `other`: the name of one that
    measures it by other means, so that both are there on purpose."""

    name: str
    outbox: Outbox
    other: str = ""
    _own_ns: Ns | None = None  # of the newest that was used
    _other_ns: Ns | None = None  # another one's newest

    def heard_other(self, now: Ns) -> None:
        """Another service has published a measurement of the same."""
        before, self._other_ns = self._other_ns, now
        if before is None or now - before > OTHER_NS:
            if self.other:
                self.outbox.tell(events.SECOND_POSITION(self.name, detail=f"now {self.other}"))
            else:
                self.outbox.tell(events.SECOND_INSTRUMENT(self.name))

    def uses_own(self, now: Ns, *, measured: bool = True) -> bool:
        """To be asked for each sample of its own; one may say only that it measures nothing."""
        if _within(self._other_ns, now) and not _within(self._own_ns, now):
            return False
        self._own_ns = now if measured else self._own_ns
        return True


def _within(then: Ns | None, now: Ns) -> bool:
    return then is not None and now - then <= OTHER_NS
