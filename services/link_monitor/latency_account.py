"""Latency from the stick to the thruster and from the sensor to the screen, stage by stage.

Every message carries the stamps of its causes, so each stage is a difference of two stamps. Only
the time at which a command leaves the tether is not recorded: that stage is measured by the pings,
and the rest is the time `reference` waits for the next state.

The stages reported are those of the median command: the mean over the commands of the middle fifth
with the same total latency, so that they add up to the end-to-end median. The medians of the single
stages would not.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from messages.control import ThrusterCommand
from messages.link import DOWN_STAGES, UP_STAGES, LatencyBudget, Shown, Stage
from messages.message import Notice
from messages.pilot import PilotCommand
from messages.reference import Reference
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import Actuation
from services.marine.summation import plain_sum

WINDOW_NS = 2_000_000_000  # [ns] the budget covers the last two seconds
SAME_NS = 5_000_000  # [ns] a quarter of the time between two commands
AT_LEAST = 5  # commands or samples that a median needs
PAUSE_NS = 500_000_000  # [ns] without a state: what a screen shows is old from then on
ALIKE = 0.02  # [-] a total latency within this share of the median's counts as the same


@dataclass(slots=True)
class CommandTrace:
    """Stamps of one pilot command on its way to the thrusters, all in the topside's clock."""

    sample_ms: float  # [ms] age of the pad's reading
    published: Ns  # [ns] received by the link monitor, on the topside's bus
    reference: Ns | None = None  # [ns]
    control: Ns | None = None  # [ns]


@dataclass(slots=True)
class LatencyAccount:
    """Takes the messages of the control chain, gives a `LatencyBudget`."""

    _under_way: dict[Ns, CommandTrace] = field(default_factory=dict[int, CommandTrace])
    _down: deque[tuple[Ns, tuple[float, ...]]] = field(
        default_factory=deque[tuple[int, tuple[float, ...]]]
    )
    _estimation: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[int, float]])
    _up_link: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[int, float]])
    _shown: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[int, float]])
    _down_link: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[int, float]])

    _heard: Ns | None = None  # [ns] when the newest state arrived
    _lost_ns: Ns = 0  # [ns] in pauses before it
    _accounted: Ns = 0  # [ns] stamp of the newest command whose latency is known

    # Messages received.

    def command(self, command: PilotCommand, now: Ns) -> None:
        self._under_way[command.stamp_ns] = CommandTrace(command.device_age_ms, now)
        for sent in list(self._under_way):
            if sent >= now - WINDOW_NS:
                break
            del self._under_way[sent]

    def reference(self, reference: Reference, _: Ns) -> None:
        sent = self._sent(reference.pilot_ns)
        if sent is not None and self._under_way[sent].reference is None:
            self._under_way[sent].reference = reference.stamp_ns

    def thrusters(self, command: ThrusterCommand, _: Ns) -> None:
        sent = self._sent(command.pilot_ns)
        if sent is not None and self._under_way[sent].control is None:
            self._under_way[sent].control = command.stamp_ns

    def actuation(self, actuation: Actuation, now: Ns) -> None:
        sent, done, link = self._sent(actuation.pilot_ns), actuation.actuated_ns, self._link()
        if sent is None or done is None or link is None:
            return
        trace, self._accounted = self._under_way.pop(sent), sent
        if trace.reference is None or trace.control is None:
            return  # a telemetry message for this command was thinned out or lost
        publish = (trace.published - sent) / 1e6
        arrived = (trace.reference - sent) / 1e6
        link = min(link, max(0.0, arrived - publish))
        stages = (
            trace.sample_ms,
            publish,
            link,
            arrived - publish - link,
            (trace.control - trace.reference) / 1e6,
            (done - trace.control) / 1e6,
        )
        self._down.append((now, stages))

    def ping(self, downward_ms: float, now: Ns) -> None:
        """Latency of a ping from topside to drone [ms]."""
        self._down_link.append((now, downward_ms))

    def state(self, state: VehicleState, now: Ns) -> None:
        self._lost_ns, self._heard = self._lost(now), now
        self._estimation.append((now, (state.stamp_ns - state.sensor_ns) / 1e6))
        self._up_link.append((now, (now - state.stamp_ns) / 1e6))

    def shown(self, shown: Shown, now: Ns) -> None:
        self._shown.append((now, (shown.stamp_ns - shown.sensor_ns) / 1e6))

    # The report.

    def report(self, now: Ns, bound_ms: float | None, alarms: tuple[Notice, ...]) -> LatencyBudget:
        for kept in (self._estimation, self._up_link, self._shown, self._down_link, self._down):
            while kept and kept[0][0] < now - WINDOW_NS:
                kept.popleft()
        down = [stages for _, stages in self._down]
        shown = [ms for _, ms in self._shown]
        return LatencyBudget(
            stamp_ns=now,
            down=_stages(DOWN_STAGES, down),
            up=self._up(shown),
            stick_to_thruster_ms=_median([plain_sum(stages) for stages in down]),
            sensor_to_screen_ms=_median(shown),
            bound_ms=bound_ms,
            lost_s=self._lost(now) / 1e9,
            alarms=alarms,
        )

    def _lost(self, now: Ns) -> Ns:
        """[ns] In all pauses, also the one that lasts."""
        pause = 0 if self._heard is None else now - self._heard
        return self._lost_ns + (pause if pause > PAUSE_NS else 0)

    def _up(self, shown: list[float]) -> tuple[Stage, ...] | None:
        estimation = [ms for _, ms in self._estimation]
        link = [ms for _, ms in self._up_link]
        whole, typical_estimation, typical_link = map(_median, (shown, estimation, link))
        if whole is None or typical_estimation is None or typical_link is None:
            return None
        before = typical_estimation + typical_link
        screen = [max(0.0, ms - before) for ms in shown]
        columns = (estimation, link, screen)
        return tuple(
            Stage(name, max(0.0, _median(column) or 0.0), max(0.0, _high(column)))
            for name, column in zip(UP_STAGES, columns, strict=True)
        )

    def _sent(self, pilot_ns: Ns | None) -> Ns | None:
        """[ns] The stamp of the command that this stamp names; None: of none under way. A stamp
        converted to the other machine's clock and back differs by the change of the estimated clock
        offset in between."""
        if pilot_ns is None or pilot_ns in self._under_way:
            return pilot_ns
        if pilot_ns < self._accounted + SAME_NS or not self._under_way:
            return None  # another message for a command already accounted for
        nearest = min(self._under_way, key=lambda sent: abs(sent - pilot_ns))
        return nearest if abs(nearest - pilot_ns) < SAME_NS else None

    def _link(self) -> float | None:
        return _median([ms for _, ms in self._down_link])


def _stages(names: tuple[str, ...], commands: list[tuple[float, ...]]) -> tuple[Stage, ...] | None:
    if len(commands) < AT_LEAST:
        return None
    commands = sorted(commands, key=plain_sum)
    half = max(1, len(commands) // 10)
    median = plain_sum(commands[len(commands) // 2])
    middle = [
        stages
        for stages in commands[len(commands) // 2 - half : len(commands) // 2 + half + 1]
        if abs(plain_sum(stages) - median) <= ALIKE * abs(median)
    ]
    return tuple(
        Stage(
            name,
            max(0.0, plain_sum(stages[k] for stages in middle) / len(middle)),
            max(0.0, _high([stages[k] for stages in commands])),
        )
        for k, name in enumerate(names)
    )


def _median(values: Sequence[float]) -> float | None:
    """[ms] A negative latency, caused by the error of the clock offset, counts as zero; `bound_ms`
    is the greatest such error."""
    return max(0.0, sorted(values)[len(values) // 2]) if len(values) >= AT_LEAST else None


def _high(values: Sequence[float]) -> float:
    return sorted(values)[len(values) * 99 // 100]
