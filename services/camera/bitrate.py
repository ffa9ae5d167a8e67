"""How many kilobits a second the camera may send: what the link has left, with headroom.

A pure state machine on the reports of `link_monitor`, five a second. The parts of a picture leave
together and arrive as fast as the link carries them behind everything more urgent, so the pace of
their arrival is the capacity less the telemetry (packet trains: Dovrolis et al. 2001, *What do
packet dispersion techniques measure?*). The bitrate stays where it is until it does not fit, or
until more would for a while: each pace has bursts of telemetry in it.

A way that has become longer, and stays so, is a queue, whatever the pace says. What made one is
halved, approached again with headroom, and tried again after a while.

Google's congestion control (Carlucci et al. 2016) on the same reports was worse: over `severe` 5
pictures a second instead of 15, as it takes lost radio messages for a full link; and where a link
hides its room, a queue of 0.1 s or more in 37 to 88 % of the time instead of 4 to 8 %.
"""

from collections import deque
from dataclasses import dataclass, field

from messages.units import Ns
from messages.video import PictureAge
from services.marine.summation import plain_sum

FIRST_KBIT = 300.0  # [kbit/s] before anything is known
SHARE = 0.85  # [-] of the room, or of what made a queue, that is used: the rest is headroom
FULL = 0.95  # [-] of the room that has lasted, or all of that of now: more is reduced to SHARE
WORTHWHILE = 1.1  # [-] more bitrate that is worth a change, once there is room for it so long:
LASTING_NS = 2_000_000_000  # [ns]
CLEAR = 2.5  # [-] so much more room is used at once, and is that of another link
GROWTH, BLIND_GROWTH = 2.0, 1.3  # [-] at most, from one report to the next, if the room is measured
LONG_WAIT_MS, WAITS = 80.0, 5  # [ms] longer than at best in so many reports in a row: a queue
CUT, SILENT_CUT = 0.5, 0.25  # [-] of the bitrate that is left then, and where nothing arrives
MANY_LOST = 0.5  # [-] of the messages; radio loses single ones, whatever the bitrate
ROOMS = 8  # paces that are averaged
BEST_NS = 6_000_000_000  # [ns] how long the best way is remembered
DOUBT_NS = 30_000_000_000  # [ns] the law waits so long before it tries such a bitrate again …
TRIAL_NS = 9_000_000_000  # [ns] … and then in how long twice as much is
UNANSWERED_NS = 1_000_000_000  # [ns] of reports in which nothing arrived, although it was sent
SILENCE_NS, FADE_NS = 1_500_000_000, 500_000_000  # [ns] without a report; and until each halving


@dataclass(slots=True)
class BitrateLaw:
    """`budget(now)` is what may be sent."""

    least_kbit: float  # [kbit/s] a slide show, which finds out when the link is back
    most_kbit: float  # [kbit/s]
    first_kbit: float = FIRST_KBIT  # [kbit/s] before anything is known
    _kbit: float = field(default=0.0, init=False)
    _paces: deque[float] = field(default_factory=lambda: deque[float](maxlen=ROOMS))  # [kbit/s]
    _rooms: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[Ns, float]])  # [kbit/s]
    _ways: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[Ns, float]])  # [ms]
    _waits: int = 0  # reports in a row of a way that is too long
    _fades_at: Ns | None = None
    _unanswered_at: Ns | None = None  # [ns] of the first picture sent since one arrived
    _too_much: tuple[float, float] | None = None  # [kbit/s] that made a queue, and the room then
    _cut_at: Ns = 0  # [ns] when it was cut last
    _raised: bool = True  # since then

    def __post_init__(self) -> None:
        self._kbit = self._limited(self.first_kbit)

    @property
    def room_kbit(self) -> float:
        """[kbit/s] What the link has left; twice the bitrate where that was not measured. The mean
        of times, not of paces: as long as all those pictures took together."""
        if not self._paces:
            return 2.0 * self._kbit
        return len(self._paces) / plain_sum(1.0 / max(pace, 1e-3) for pace in self._paces)

    def sent(self, now: Ns) -> None:
        """A picture was sent."""
        if self._unanswered_at is None:
            self._unanswered_at = now

    def heard(self, report: PictureAge, now: Ns) -> None:
        """A report arrived."""
        self._fades_at = now + SILENCE_NS
        if report.heard_kbit == 0.0:
            if self._unanswered_at is not None and now > self._unanswered_at + UNANSWERED_NS:
                self._reduce(SILENT_CUT * self._kbit)
            return
        self._unanswered_at = None
        if report.room_kbit is not None:
            self._paces.append(report.room_kbit)
        self._rooms.append((now, self.room_kbit))
        while self._rooms[0][0] < now - LASTING_NS:
            self._rooms.popleft()
        self._count_waits(report, now)
        if self._waits >= WAITS:
            # Not raised since the last cut, the queue may be the one of before, which drains.
            too_much = self._kbit if self._raised else self._kbit / CUT
            self._too_much = too_much, self.room_kbit
            self._cut(now)
        elif report.lost <= MANY_LOST:
            self._follow(BLIND_GROWTH if report.room_kbit is None else GROWTH, now)
        elif now >= self._cut_at + UNANSWERED_NS:  # else it was sent before the cut
            self._cut(now)

    def budget(self, now: Ns) -> float:
        """[kbit/s] Without reports it fades away to the least."""
        if self._fades_at is None:
            self._fades_at = now + SILENCE_NS
        while now >= self._fades_at and self._kbit > self.least_kbit:
            self._kbit = self._limited(0.5 * self._kbit)
            self._fades_at += FADE_NS
        return self._kbit

    def _follow(self, growth: float, now: Ns) -> None:
        """Down when there is no room for it, up when it is worth it."""
        room, rooms = self.room_kbit, [each for _, each in self._rooms]
        if self._kbit > min(room, FULL * max(rooms)):
            self._reduce(SHARE * room)
            return
        wanted = SHARE * (room if SHARE * room > CLEAR * self._kbit else min(rooms))
        if self._too_much is not None:
            too_much, room_then = self._too_much
            if room > CLEAR * room_then:  # another link
                self._too_much = None
            else:
                trial = max(0.0, (now - self._cut_at - DOUBT_NS) / TRIAL_NS)
                wanted = min(wanted, SHARE * too_much * 2.0 ** min(trial, 20.0))
        wanted = self._limited(wanted)
        worth_it = wanted > WORTHWHILE * self._kbit or wanted == self.most_kbit
        if worth_it and self._waits == 0:
            self._kbit, self._raised = min(growth * self._kbit, wanted), True

    def _cut(self, now: Ns) -> None:
        self._waits, self._raised, self._cut_at = 0, False, now
        self._reduce(CUT * self._kbit)

    def _reduce(self, kbit: float) -> None:
        if self._kbit == self.least_kbit:  # not longer because of us: it is another way
            self._ways.clear()
            self._too_much = None
        self._kbit = self._limited(min(kbit, self._kbit))

    def _count_waits(self, report: PictureAge, now: Ns) -> None:
        """Is the way longer than the best one lately, and than pictures of this size take?"""
        way = next((s.p50_ms for s in report.stages or () if s.name == "crossed"), None)
        if way is None:
            return
        while self._waits == 0 and self._ways and self._ways[0][0] < now - BEST_NS:
            self._ways.popleft()
        self._ways.append((now, way))
        picture = report.heard_kbit / max(report.per_second, 1.0)  # [kbit]
        best = min(each for _, each in self._ways)
        longest = best + LONG_WAIT_MS + 1e3 * picture / self.room_kbit
        self._waits = self._waits + 1 if way > longest else 0

    def _limited(self, kbit: float) -> float:
        return min(max(kbit, self.least_kbit), self.most_kbit)
