"""How many kilobits a second the camera may send: what the link has left, with headroom.

A pure state machine on the reports of `camera_monitor`, five a second. The parts of a picture leave
together and arrive as fast as the link carries them behind everything more urgent, so the pace of
their arrival is the capacity less the telemetry (packet trains: Dovrolis et al. 2001, *What do
packet dispersion techniques measure?*). A way that becomes longer than it was is a queue, whatever
the pace says.
"""

from collections import deque
from dataclasses import dataclass, field
from statistics import median

from messages.units import Ns
from messages.video import PictureAge

FIRST_KBIT = 300.0  # [kbit/s] before anything is known
SHARE = 0.75  # [-] of the room that is used: the rest is headroom
GROWTH, BLIND_GROWTH = 1.8, 1.3  # [-] at most, from one report to the next, if the room is measured
LONG_WAIT_MS = 80.0  # [ms] longer on the way than at best: too much was sent
CUT = 0.6  # [-] of the bitrate that is left then …
SILENT_CUT = 0.4  # [-] … and where nothing arrives
MANY_LOST = 0.5  # [-] of the messages; radio loses single ones, whatever the bitrate
ROOMS = 5  # reports whose median is believed
BEST_NS = 6_000_000_000  # [ns] how long the best way is remembered
UNANSWERED_NS = 500_000_000  # [ns] of reports in which nothing arrived, although it was sent
SILENCE_NS = 1_000_000_000  # [ns] without a report
FADE_NS = 500_000_000  # [ns] without a report the bitrate is halved as often


@dataclass(slots=True)
class BitrateLaw:
    """`budget(now)` is what may be sent."""

    least_kbit: float  # [kbit/s] a slide show, which finds out when the link is back
    most_kbit: float  # [kbit/s]
    _kbit: float = FIRST_KBIT
    _rooms: deque[float] = field(default_factory=lambda: deque[float](maxlen=ROOMS))
    _ways: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[Ns, float]])
    _fades_at: Ns | None = None
    _unanswered_at: Ns | None = None  # [ns] of the first picture sent since one arrived

    def __post_init__(self) -> None:
        self._kbit = self._limited(self._kbit)

    @property
    def room_kbit(self) -> float:
        """[kbit/s] What the link has left; twice the bitrate where that was not measured."""
        return median(self._rooms) if self._rooms else 2.0 * self._kbit

    def sent(self, now: Ns) -> None:
        """A picture was sent."""
        if self._unanswered_at is None:
            self._unanswered_at = now

    def heard(self, report: PictureAge, now: Ns) -> None:
        """A report arrived."""
        self._fades_at = now + SILENCE_NS
        if report.heard_kbit == 0.0:
            if self._unanswered_at is not None and now > self._unanswered_at + UNANSWERED_NS:
                self._cut(SILENT_CUT)
            return
        self._unanswered_at = None
        if self._waits(report, now) or report.lost > MANY_LOST:
            self._rooms.clear()  # measured on a better link
            self._measure(report)
            self._cut(CUT)
        else:
            growth = BLIND_GROWTH if report.room_kbit is None else GROWTH
            self._measure(report)
            self._kbit = self._limited(min(growth * self._kbit, SHARE * self.room_kbit))

    def budget(self, now: Ns) -> float:
        """[kbit/s] Without reports it fades away to the least."""
        if self._fades_at is None:
            self._fades_at = now + SILENCE_NS
        while now >= self._fades_at and self._kbit > self.least_kbit:
            self._kbit = self._limited(0.5 * self._kbit)
            self._fades_at += FADE_NS
        return self._kbit

    def _measure(self, report: PictureAge) -> None:
        if report.room_kbit is not None:
            self._rooms.append(report.room_kbit)

    def _cut(self, left: float) -> None:
        if self._kbit == self.least_kbit:
            self._ways.clear()  # not longer because of us: it is another way
        self._kbit = self._limited(min(left * self._kbit, SHARE * self.room_kbit))

    def _waits(self, report: PictureAge, now: Ns) -> bool:
        """Is the way longer than the best one lately, and than pictures of this size take?"""
        way = next((s.p50_ms for s in report.stages or () if s.name == "crossed"), None)
        if way is None:
            return False
        while self._ways and self._ways[0][0] < now - BEST_NS:
            self._ways.popleft()
        while self._ways and self._ways[-1][1] >= way:  # never the best again
            self._ways.pop()
        self._ways.append((now, way))
        picture = report.heard_kbit / max(report.per_second, 1.0)  # [kbit]
        return way > self._ways[0][1] + LONG_WAIT_MS + 1e3 * picture / self.room_kbit

    def _limited(self, kbit: float) -> float:
        return min(max(kbit, self.least_kbit), self.most_kbit)
