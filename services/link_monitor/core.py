"""State of the link monitor: link alarm, clock synchronisation and latency budget."""

from dataclasses import dataclass, field

from msgspec.structs import replace

from messages import events
from messages.events import Outbox
from messages.link import Clock, ClockPing, ClockPong, LatencyBudget
from messages.pilot import PilotCommand
from messages.units import Ns
from services.link_monitor.clock_sync import ClockSync
from services.link_monitor.latency_account import LatencyAccount
from services.link_monitor.link_alarm import LinkAlarm


@dataclass(slots=True)
class LinkMonitor:
    outbox: Outbox
    source: int = 0  # names this topside's pings
    misfit: str = ""  # why the two sides do not fit together, in words for the pilot
    junk: str = ""  # who cannot read what, in words for the pilot
    budget: LatencyAccount = field(default_factory=LatencyAccount)
    _sync: ClockSync = field(init=False)
    _alarm: LinkAlarm = field(default_factory=LinkAlarm)
    _published: str = ""  # the alarm as last published
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
        text = self._alarm.text(now)
        if bool(text) == bool(self._published):
            return False
        self._published = text
        if text:
            self.outbox.tell(events.ALARM_LINK(detail=text))
        else:
            self.outbox.say("info", "the link is back to normal")
        return True

    def report(self, now: Ns) -> LatencyBudget:
        bound_ns = self._sync.clock(now).bound_ns
        bound_ms = None if bound_ns is None else bound_ns / 1e6
        alarm = "; ".join(filter(None, (self.misfit, self.junk, self._alarm.text(now))))
        return self.budget.report(now, bound_ms, alarm)


def pong(ping: ClockPing, heard_ns: Ns) -> ClockPong:
    """The answer to a ping that is handled at `heard_ns` by the drone's clock."""
    return ClockPong(
        stamp_ns=heard_ns, ping_ns=ping.stamp_ns, heard_ns=heard_ns, source=ping.source
    )
