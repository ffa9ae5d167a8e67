"""How many kilobits a second the camera may send: what the link has left, with headroom.

A pure state machine on the reports of `camera_monitor`, five a second. The parts of a picture leave
together and arrive as fast as the link carries them behind everything more urgent, so the pace of
their arrival is the capacity less the telemetry (packet trains: Dovrolis et al. 2001, *What do
packet dispersion techniques measure?*). A way that has become longer, and stays so, is a queue,
whatever the pace says.

Each pace is a measurement of a short moment, with bursts of telemetry in it. So the bitrate does
not follow it: it stays where it is until it does not fit, or until much more would, and a bitrate
that has made a queue is not tried again soon. On a link that does not change it settles.
"""

from collections import deque
from dataclasses import dataclass, field

from messages.units import Ns
from messages.video import PictureAge
from services.marine.summation import plain_sum

FIRST_KBIT = 300.0  # [kbit/s] before anything is known
SHARE = 0.85  # [-] of the room that is used: the rest is headroom
FULL = 0.95  # [-] of the room that has lasted, or all of that of now: more is reduced to SHARE
WORTHWHILE = 1.1  # [-] more bitrate that is worth a change …
LASTING_NS = 2_000_000_000  # [ns] … once there has been room for it as long …
TRIAL = 1.25  # [-] step of a bitrate that is tried again
CLEAR = 2.5  # [-] … or at once, if there is room for so much more
GROWTH, BLIND_GROWTH = 2.0, 1.3  # [-] at most, from one report to the next, if the room is measured
LONG_WAIT_MS = 80.0  # [ms] longer on the way than at best: too much was sent …
WAITS = 5  # … if so many reports in a row say so: a single one may be a burst of telemetry
CUT = 0.5  # [-] of the bitrate that is left then …
SILENT_CUT = 0.25  # [-] … and where nothing arrives
MANY_LOST = 0.5  # [-] of the messages; radio loses single ones, whatever the bitrate
ROOMS = 8  # paces that are averaged
BEST_NS = 6_000_000_000  # [ns] how long the best way is remembered
DOUBT_NS = 20_000_000_000  # [ns] how long a bitrate that made a queue is not tried again …
MOST_DOUBT_NS = 160_000_000_000  # [ns] … after it did so again and again …
TRIAL_NS = 3_000_000_000  # [ns] … and then step by step, if the room looks as it did
UNANSWERED_NS = 1_000_000_000  # [ns] of reports in which nothing arrived, although it was sent
SILENCE_NS = 1_500_000_000  # [ns] without a report
FADE_NS = 500_000_000  # [ns] without a report the bitrate is halved as often


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
    _too_much: float | None = None  # [kbit/s] that made a queue …
    _doubted_room: float = 0.0  # [kbit/s] … while so much was measured …
    _trusted_at: Ns = 0  # [ns] … and is not tried before
    _doubt_ns: Ns = DOUBT_NS
    _on_trial: bool = False
    _lost_at: Ns = 0  # [ns] when it was reduced last because most was lost

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
        self._remember_room(now)
        self._count_waits(report, now)
        if self._waits >= WAITS:
            self._waits = 0
            self._doubt(now)
            self._reduce(CUT * self._kbit)
        elif report.lost > MANY_LOST:
            # What is lost so soon after a cut was sent before it.
            if now >= self._lost_at + UNANSWERED_NS:
                self._lost_at = now
                self._reduce(CUT * self._kbit)
        else:
            self._follow(BLIND_GROWTH if report.room_kbit is None else GROWTH, now)

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
        greatest = max(room for _, room in self._rooms)
        if self._kbit > min(self.room_kbit, FULL * greatest):
            self._reduce(SHARE * self.room_kbit)
            return
        clear = SHARE * self.room_kbit > CLEAR * self._kbit
        least = min(room for _, room in self._rooms)
        wanted = SHARE * (self.room_kbit if clear else least)
        wanted = self._limited(min(wanted, self._trusted(now)))
        worth_it = wanted > WORTHWHILE * self._kbit or wanted == self.most_kbit
        if worth_it and self._waits == 0:
            self._kbit = min(growth * self._kbit, wanted)

    def _reduce(self, kbit: float) -> None:
        if self._kbit == self.least_kbit:  # not longer because of us: it is another way
            self._ways.clear()
            self._forgive()
        self._kbit = self._limited(min(kbit, self._kbit))

    def _doubt(self, now: Ns) -> None:
        """This bitrate has made a queue; or it is still that of a much higher one before."""
        recent = now < self._trusted_at - self._doubt_ns + TRIAL_NS
        if self._too_much is not None and recent:
            # One cut is enough where the measured room is like it: the queue has to drain.
            once, alike = CUT * self._too_much, self.room_kbit < CLEAR * self._too_much
            if self._kbit < once or (self._kbit == once and alike):
                return
        self._doubt_ns = min(2 * self._doubt_ns, MOST_DOUBT_NS) if self._on_trial else DOUBT_NS
        self._on_trial = False
        self._too_much, self._doubted_room = self._kbit, self.room_kbit
        self._trusted_at = now + self._doubt_ns

    def _trusted(self, now: Ns) -> float:
        """[kbit/s] That may be tried, after what has made a queue."""
        if self._too_much is None:
            return self.most_kbit
        if self.room_kbit > CLEAR * self._doubted_room or SHARE * self._too_much > self.most_kbit:
            self._forgive()  # another link, or far from it
            return self.most_kbit
        if now >= self._trusted_at:
            self._on_trial = True
            self._too_much *= TRIAL
            self._trusted_at = now + TRIAL_NS
        return SHARE * self._too_much

    def _forgive(self) -> None:
        self._too_much, self._on_trial = None, False

    def _remember_room(self, now: Ns) -> None:
        self._rooms.append((now, self.room_kbit))
        while self._rooms[0][0] < now - LASTING_NS:
            self._rooms.popleft()

    def _count_waits(self, report: PictureAge, now: Ns) -> None:
        """Is the way longer than the best one lately, and than pictures of this size take?"""
        way = next((s.p50_ms for s in report.stages or () if s.name == "crossed"), None)
        if way is None:
            return
        while self._waits == 0 and self._ways and self._ways[0][0] < now - BEST_NS:
            self._ways.popleft()
        while self._ways and self._ways[-1][1] >= way:  # never the best again
            self._ways.pop()
        self._ways.append((now, way))
        picture = report.heard_kbit / max(report.per_second, 1.0)  # [kbit]
        longest = self._ways[0][1] + LONG_WAIT_MS + 1e3 * picture / self.room_kbit
        self._waits = self._waits + 1 if way > longest else 0

    def _limited(self, kbit: float) -> float:
        return min(max(kbit, self.least_kbit), self.most_kbit)
