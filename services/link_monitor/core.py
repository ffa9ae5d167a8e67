"""State of the link monitor: alarm, floods of junk, clock synchronisation, latency budget.

Clock synchronisation: offset of the drone's clock from the topside's, with a guaranteed bound.

A ping is sent at t1 (topside), received at t2 (drone), answered at t3 (drone) and received back at
t4 (topside). Neither delay is negative, so the drone's clock is ahead by at least t3 - t4 and at
most t2 - t1. Every round trip gives such an interval; the true offset lies in all of them, so in
their intersection (Marzullo and Owicki 1983). Symmetry is not assumed: a link that is slow in one
direction only makes the interval wider. The fastest message of each direction counts, which is
NTP's minimum filter (RFC 5905, section 10) for each direction by itself.

Crystals differ, so an interval is widened by `DRIFT` for every second of its age.
"""

from collections import deque
from dataclasses import dataclass, field
from math import inf
from statistics import median

from msgspec.structs import replace

from messages import events
from messages.events import Outbox
from messages.health import Health
from messages.link import Clock, ClockPong, LatencyBudget
from messages.message import Notice
from messages.pilot import PilotCommand
from messages.units import Ns
from services.link_monitor.latency_account import LatencyAccount

DRIFT = 100e-6  # [-] greatest difference of two crystals: 50 ppm each, over temperature
SHORTEST_S = 20.0  # [s] between two estimates, for a useful drift
SILENT_NS = 1_000_000_000  # [ns] without an answer the round trip time is unknown


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """One round trip."""

    sent: int  # [ns] t1, topside
    back: int  # [ns] t4, topside
    least: int  # [ns] t3 - t4: the drone's clock is ahead by no less
    most: int  # [ns] t2 - t1: … and by no more
    rtt: int  # [ns] without the drone's own time


@dataclass(slots=True)
class ClockSync:
    """Takes pongs, gives a `Clock`."""

    outbox: Outbox
    # The one that bounds the offset from below, that from above, and the newest: all bounds widen
    # alike, so no other ever counts again.
    _trips: list[RoundTrip] = field(default_factory=list[RoundTrip])
    _fastest: float = inf  # [ns] round trip
    _first: tuple[int, float] | None = None  # ([ns] when, [ns] ahead) to measure the drift from

    def heard(self, pong: ClockPong, now: int) -> None:
        """A pong arrived at `now` [ns], topside."""
        trip = RoundTrip(
            sent=pong.ping_ns,
            back=now,
            least=pong.stamp_ns - now,
            most=pong.heard_ns - pong.ping_ns,
            rtt=(now - pong.ping_ns) - (pong.stamp_ns - pong.heard_ns),
        )
        if trip.least > trip.most + DRIFT * (now - trip.sent) + 2:  # stamps are whole nanoseconds
            self.outbox.tell(events.IMPOSSIBLE_PONG())
            return
        every = [*self._trips, trip]
        lowest = max(every, key=lambda each: each.least + DRIFT * (each.sent - now))
        highest = min(every, key=lambda each: each.most - DRIFT * (each.sent - now))
        self._trips, self._fastest = [lowest, highest, trip], min(self._fastest, trip.rtt)
        least, most = self._band(now)
        if least > most + 2:
            # Two steady clocks cannot give both intervals: one of them was set.
            self.outbox.tell(events.JUMPED_CLOCK())
            self._trips, self._fastest = [trip], trip.rtt
            self._first = None

    def clock(self, now: int) -> Clock:
        """The estimate at `now` [ns]; None for whatever is not known now."""
        if not self._trips:
            return _unknown(now)
        least, most = self._band(now)
        ahead = (least + most) / 2
        newest = self._trips[-1]
        answered = now - newest.back
        return Clock(
            stamp_ns=now,
            offset_ns=round(ahead),
            bound_ns=max(0, round((most - least) / 2)) + 2,
            drift_ppm=self._drift(ahead, now),
            rtt_ms=newest.rtt / 1e6 if answered < SILENT_NS else None,
            rtt_min_ms=self._fastest / 1e6,
            answered_ms=max(0.0, answered / 1e6),
        )

    def downward_ms(self, pong: ClockPong, now: int) -> float | None:
        """[ms] Latency of this ping from topside to drone, by the estimated clock offset."""
        if not self._trips:
            return None
        least, most = self._band(now)
        return max(0.0, (pong.heard_ns - pong.ping_ns - (least + most) / 2) / 1e6)

    def _band(self, now: int) -> tuple[float, float]:
        """[ns] The drone's clock is ahead by at least and at most this."""
        least = max(trip.least - DRIFT * (now - trip.sent) for trip in self._trips)
        most = min(trip.most + DRIFT * (now - trip.sent) for trip in self._trips)
        return least, most

    def _drift(self, ahead: float, now: int) -> float | None:
        """[ppm] How fast the drone's clock gains on the topside's; None until it is known."""
        if self._first is None:
            self._first = (now, ahead)
        since, then = self._first
        if now - since < SHORTEST_S * 1e9:
            return None
        return (ahead - then) / (now - since) * 1e6


def _unknown(now: int) -> Clock:
    return Clock(
        stamp_ns=now,
        offset_ns=None,
        bound_ns=None,
        drift_ppm=None,
        rtt_ms=None,
        rtt_min_ms=None,
        answered_ms=None,
    )


USUAL = 300  # round trips whose median is the usual one; a minute at 5 Hz
IN_A_ROW = 2  # slow answers before the alarm; a single one may be chance
RISE_MS = 50.0  # [ms] above the usual round trip, at least
RISE = 1.0  # [-] and at least this share of the usual one
START_MS = 3000.0  # [ms] for the drone's first answer: the other side may still be starting
SILENT_MS = 500.0  # [ms] without an answer, beyond the usual round trip


@dataclass(slots=True)
class LinkAlarm:
    """Takes pings and answers; `notice` is what is wrong."""

    _usual: deque[float] = field(default_factory=lambda: deque[float](maxlen=USUAL))
    _slow: int = 0  # answers in a row
    _newest_ms: float = 0.0
    _unanswered: Ns | None = None  # [ns] when the oldest unanswered ping was sent
    _ever: bool = False

    def sent(self, now: Ns) -> None:
        if self._unanswered is None:
            self._unanswered = now

    def answered(self, rtt_ms: float) -> None:
        """A ping came back."""
        self._ever, self._unanswered, self._newest_ms = True, None, rtt_ms
        usual = self._usual_ms()
        if usual is not None and rtt_ms > usual + max(RISE_MS, RISE * usual):
            self._slow += 1
        else:
            self._slow = 0
        # For a link that stays slow, that becomes usual after half a minute.
        self._usual.append(rtt_ms)

    def notice(self, now: Ns) -> Notice | None:
        """None: nothing."""
        usual = self._usual_ms() or 0.0
        waits_ms = 0.0 if self._unanswered is None else (now - self._unanswered) / 1e6
        if waits_ms > (SILENT_MS + usual if self._ever else START_MS):
            if not self._ever:
                return Notice("link.never")
            return Notice("link.silent", {"s": round(waits_ms / 1e3, 1)})
        if self._slow >= IN_A_ROW:
            return Notice("link.rtt", {"from": round(usual), "to": round(self._newest_ms)})
        return None

    def _usual_ms(self) -> float | None:
        return median(self._usual) if self._usual else None


UNREADABLE = {
    *(events.MALFORMED.name, events.WRONG_TYPE.name, events.OVERSIZED.name),
    *(events.UNKNOWN_KEY.name, events.TOO_MANY_KEYS.name),
}  # kinds of events
MOST_HZ = 20.0  # [1/s] unreadable messages of one service; more is a flood
RECENT_NS = 3_000_000_000  # [ns] of health messages, of one a second
PROCESSES = 64  # that are told apart


@dataclass(slots=True)
class JunkWatch:
    """Takes health messages; a broken sensor is no flood."""

    # (side, service, its process) → when it was heard, and what it could not read since its start.
    _heard: dict[tuple[str, str, int], tuple[Ns, int]] = field(
        default_factory=dict[tuple[str, str, int], tuple[Ns, int]]
    )
    _flooded_ns: Ns = -RECENT_NS  # [ns] when the newest flood was heard of
    _flooded: Notice | None = None  # by whom, newest

    def health(self, health: Health, now: Ns) -> None:
        names = (name.partition(":") for name in health.counts)
        unreadable = sum(
            health.counts[f"{kind}:{key}"]
            for kind, _, key in names
            if kind in UNREADABLE and not key.startswith("sensor/")
        )
        whose = health.side, health.service, health.instance
        if len(self._heard) >= PROCESSES:  # of restarts, or invented ones
            self._heard.clear()
        at_ns, before = self._heard.get(whose, (now, unreadable))
        self._heard[whose] = now, unreadable
        if now <= at_ns or unreadable - before <= MOST_HZ * (now - at_ns) * 1e-9:
            return
        if not self.notice(now):  # the service that is flooded first; later ones say no more
            hz = round((unreadable - before) / ((now - at_ns) * 1e-9))
            self._flooded = Notice(events.ALARM_JUNK.name, {"hz": hz}, (health.service,))
        self._flooded_ns = now

    def notice(self, now: Ns) -> Notice | None:
        """None: nothing is flooded."""
        return self._flooded if now - self._flooded_ns < RECENT_NS else None


@dataclass(slots=True)
class LinkMonitor:
    outbox: Outbox
    source: int = 0  # names this topside's pings
    misfit: str = ""  # why the two sides do not fit together, in words for the pilot
    junk: Notice | None = None  # which service cannot read what it receives
    budget: LatencyAccount = field(default_factory=LatencyAccount)
    _sync: ClockSync = field(init=False)
    _alarm: LinkAlarm = field(default_factory=LinkAlarm)
    _published: bool = False  # that there is an alarm
    _epoch: int = 0  # of the newest command of this topside

    def __post_init__(self) -> None:
        self._sync = ClockSync(self.outbox)

    def ping(self, now: Ns) -> Clock:
        """A ping is sent; returns the clock offset to publish with it."""
        self._alarm.sent(now)
        return replace(self._sync.clock(now), source=self.source, epoch=self._epoch)

    def command(self, command: PilotCommand, now: Ns) -> None:
        self._epoch = command.epoch
        self.budget.command(command, now)

    def pong(self, pong: ClockPong, now: Ns) -> None:
        if pong.source != self.source:
            return  # the answer to another topside, by whose clock it is stamped
        self._sync.heard(pong, now)
        self._alarm.answered((now - pong.ping_ns) / 1e6)
        if (downward_ms := self._sync.downward_ms(pong, now)) is not None:
            self.budget.ping(downward_ms, now)

    def news(self, now: Ns) -> bool:
        """Has the alarm begun, or is it over? It is told."""
        notice = self._alarm.notice(now)
        if (notice is not None) == self._published:
            return False
        self._published = notice is not None
        if notice is not None:
            self.outbox.tell(events.ALARM_LINK(detail=events.told(notice)))
        else:
            self.outbox.say("info", "the link is back to normal")
        return True

    def report(self, now: Ns) -> LatencyBudget:
        bound_ns = self._sync.clock(now).bound_ns
        bound_ms = None if bound_ns is None else bound_ns / 1e6
        misfit = Notice(events.ALARM_PEERS.name, more=self.misfit) if self.misfit else None
        alarms = filter(None, (misfit, self.junk, self._alarm.notice(now)))
        return self.budget.report(now, bound_ms, tuple(alarms))
