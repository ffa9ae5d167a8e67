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
GROWTH = 1.35  # [-] at most, from one report to the next
LONG_WAIT_MS = 80.0  # [ms] longer on the way than at best: too much was sent
CUT = 0.6  # [-] of the bitrate that is left then
MANY_LOST = 0.5  # [-] of the pictures; radio loses single ones, whatever the bitrate
ROOMS = 5  # reports whose median is believed
BEST_NS = 20_000_000_000  # [ns] how long the best way is remembered
SILENCE_NS = 1_000_000_000  # [ns] without a report: nobody may be there
FADE_NS = 500_000_000  # [ns] then the bitrate is halved as often


@dataclass(slots=True)
class BitrateLaw:
    """`budget(now)` is what may be sent."""

    least_kbit: float  # [kbit/s] a slide show, which finds out when the link is back
    most_kbit: float  # [kbit/s]
    _kbit: float = FIRST_KBIT
    _rooms: deque[float] = field(default_factory=lambda: deque[float](maxlen=ROOMS))
    _ways: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[Ns, float]])
    _fades_at: Ns | None = None
    _arrived_at: Ns | None = None  # [ns] of the last report of anything that arrived

    def __post_init__(self) -> None:
        self._kbit = self._limited(self._kbit)

    @property
    def room_kbit(self) -> float:
        """[kbit/s] What the link has left; twice the bitrate where that was not measured."""
        return median(self._rooms) if self._rooms else 2.0 * self._kbit

    def heard(self, report: PictureAge, now: Ns) -> None:
        """A report arrived."""
        self._fades_at = now + SILENCE_NS
        if self._arrived_at is None or report.heard_kbit > 0.0:
            self._arrived_at = now
        if report.heard_kbit == 0.0:
            if now > self._arrived_at + SILENCE_NS:
                self._kbit = self._limited(CUT * self._kbit)
            return
        if report.room_kbit is not None:
            self._rooms.append(report.room_kbit)
        if self._waits(report, now) or report.lost > MANY_LOST:
            self._rooms.clear()  # measured on a better link
            if report.room_kbit is not None:
                self._rooms.append(report.room_kbit)
            self._kbit = self._limited(min(CUT * self._kbit, SHARE * self.room_kbit))
        else:
            self._kbit = self._limited(min(GROWTH * self._kbit, SHARE * self.room_kbit))

    def budget(self, now: Ns) -> float:
        """[kbit/s] Without reports it fades away to the least."""
        if self._fades_at is None:
            self._fades_at = now + SILENCE_NS
        while now >= self._fades_at and self._kbit > self.least_kbit:
            self._kbit = self._limited(0.5 * self._kbit)
            self._fades_at += FADE_NS
        return self._kbit

    def _waits(self, report: PictureAge, now: Ns) -> bool:
        """Is the way longer than the best one lately?"""
        way = next((s.p50_ms for s in report.stages or () if s.name == "crossed"), None)
        if way is None:
            return False
        while self._ways and self._ways[0][0] < now - BEST_NS:
            self._ways.popleft()
        while self._ways and self._ways[-1][1] >= way:  # never the best again
            self._ways.pop()
        self._ways.append((now, way))
        return way > self._ways[0][1] + LONG_WAIT_MS

    def _limited(self, kbit: float) -> float:
        return min(max(kbit, self.least_kbit), self.most_kbit)
