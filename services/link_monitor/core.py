"""State of the link monitor: link alarm, clock synchronisation and latency budget."""

from dataclasses import dataclass, field

from msgspec.structs import replace

from messages.link import Clock, ClockPong, LatencyBudget
from messages.pilot import PilotCommand
from messages.units import Ns
from services.link_monitor.clock_sync import ClockSync
from services.link_monitor.latency_account import LatencyAccount
from services.link_monitor.link_alarm import LinkAlarm


@dataclass(slots=True)
class LinkMonitor:
    """`events` collects what must be counted."""

    source: int = 0  # names this topside's pings
    events: list[str] = field(default_factory=list[str])
    misfit: str = ""  # why the two sides do not fit together, in words for the pilot
    junk: str = ""  # who cannot read what, in words for the pilot
    budget: LatencyAccount = field(default_factory=LatencyAccount)
    _sync: ClockSync = field(default_factory=ClockSync)
    _alarm: LinkAlarm = field(default_factory=LinkAlarm)
    _published: str = ""  # the alarm as last published
    _epoch: int = 0  # of the newest command of this topside

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
        alarm = "; ".join(filter(None, (self.misfit, self.junk, self._alarm.text(now))))
        return self.budget.report(now, bound_ms, alarm)
