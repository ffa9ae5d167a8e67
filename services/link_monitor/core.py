"""State of the link monitor: link alarm, clock synchronisation and latency budget."""

from dataclasses import dataclass, field

from messages.link import Clock, ClockPong, LatencyBudget
from messages.units import Ns
from services.link_monitor.clock_sync import ClockSync
from services.link_monitor.latency_account import LatencyAccount
from services.link_monitor.link_alarm import LinkAlarm


@dataclass(slots=True)
class LinkMonitor:
    """`events` collects what must be counted."""

    events: list[str] = field(default_factory=list[str])
    budget: LatencyAccount = field(default_factory=LatencyAccount)
    _sync: ClockSync = field(default_factory=ClockSync)
    _alarm: LinkAlarm = field(default_factory=LinkAlarm)
    _published: str = ""  # the alarm as last published

    def ping(self, now: Ns) -> Clock:
        """A ping is sent; returns the clock offset to publish with it."""
        self._alarm.sent(now)
        return self._sync.clock(now)

    def pong(self, pong: ClockPong, now: Ns) -> None:
        self._sync.heard(pong, now)
        self._alarm.answered((now - pong.ping_ns) / 1e6)
        if (downward_ms := self._sync.downward_ms(pong, now)) is not None:
            self.budget.ping(downward_ms, now)
        self.events.extend(self._sync.events)
        self._sync.events.clear()

    def news(self, now: Ns) -> str | None:
        """The alarm when it begins (empty text: it is over); None: no change."""
        text = self._alarm.text(now)
        if bool(text) == bool(self._published):
            return None
        self._published = text
        if text:
            self.events.append("alarm:link")
        return text

    def report(self, now: Ns) -> LatencyBudget:
        bound_ns = self._sync.clock(now).bound_ns
        bound_ms = None if bound_ns is None else bound_ns / 1e6
        return self.budget.report(now, bound_ms, self._alarm.text(now))
