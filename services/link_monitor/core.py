"""State of the link monitor: alarm, clock synchronisation, latency budget."""

from collections import deque
from dataclasses import dataclass, field
from statistics import median

from msgspec.structs import replace

from messages import events
from messages.events import Outbox
from messages.link import Clock, ClockPong, LatencyBudget
from messages.message import Notice
from messages.pilot import PilotCommand
from messages.units import Ns
from services.link_monitor.clock_sync import ClockSync
from services.link_monitor.latency_account import LatencyAccount

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


@dataclass(slots=True)
class LinkMonitor:
    outbox: Outbox
    source: int = 0  # names this topside's pings
    misfit: str = ""  # why the two sides do not fit together, in words for the pilot
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
        alarms = filter(None, (misfit, self._alarm.notice(now)))
        return self.budget.report(now, bound_ms, tuple(alarms))
