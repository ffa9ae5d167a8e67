"""The failsafe table: what makes the drone act by itself, when it holds, in which stages it acts,
and what ends it. And what is known of the vehicle and its services, by which that is judged.

`docs/failsafes.md` is written from it (`make docs`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, get_args

from messages import events
from messages.control import Wrench
from messages.events import Condition
from messages.health import LATE_MS, Health
from messages.pilot import TTL_MS, PilotCommand
from messages.sensors import AltitudeSample, BatterySample, DvlSample, LeakSample, TemperatureSample
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import Reaction
from services.reference.settings import FailsafeSettings

SEVERITY: tuple[Reaction, ...] = get_args(Reaction)  # the mildest first
ACTING: tuple[Reaction, ...] = ("stop", "ascend", "surface")  # they take the sticks from the pilot

SHORT_NS = 2_000_000_000  # [ns] a loss that lasts so long is none that ends by itself
LINK_PATIENCE_NS = 1_000_000_000  # [ns] without sticks and pings
CONTROL_PATIENCE_NS = 500_000_000  # [ns] without a wrench
HEALTH_PATIENCE_NS = 3_000_000_000  # [ns] without a health message, of one a second
BOARD_PATIENCE_NS = 2_500_000_000  # [ns] without a count of a silent board, of one a second
RECENT_NS = 10_000_000_000  # [ns] so long the pilot reads of an event that has no end
TOO_DEEP = 0.5  # [m] below the limit: more than a reference at the limit is overshot
WORSE = 0.04  # [-] of the battery's charge: so much less is worse
# What a service of this role counts again as long as, or as often as, it happens.
COUNTED = {
    "motion": events.SILENT_BOARD, "recorder": events.DISK_ERROR, "clock": events.JUMPED_CLOCK,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class WatchedMessages:
    """The newest message of each vehicle-side topic; None: none yet, or not fresh."""

    wrench: Wrench | None = None
    battery: BatterySample | None = None
    leak: LeakSample | None = None
    temperature: TemperatureSample | None = None
    dvl: DvlSample | None = None
    altimeter: AltitudeSample | None = None


NO_MESSAGES = WatchedMessages()


class Holding(NamedTuple):
    """A condition that holds now."""

    level: int = 0  # [-] how bad; a greater one is worse
    numbers: Mapping[str, float] = {}  # as in a notice
    about: tuple[str, ...] = ()  # which sensor, thruster, service …


@dataclass(slots=True)
class ConditionWatch:
    """What the conditions are judged by, at one step."""

    settings: FailsafeSettings
    watched: Mapping[str, str] = field(default_factory=dict[str, str])  # service → its role
    started_ns: Ns = 0  # [ns] now, when this was made
    # Of this step.
    newest: WatchedMessages = NO_MESSAGES
    state: VehicleState | None = None  # the newest fresh one
    command: PilotCommand | None = None  # the newest fresh one
    now: Ns = 0
    armed: bool = False
    unheld: tuple[str, ...] = ()  # axes that the mode holds, but whose estimates are not valid
    limited: bool = False  # the reference comes to rest at the depth limit
    above_floor: bool = False  # it does above the bottom, although the stick points down
    pinged_ns: Ns | None = None
    _commanded: bool = False  # a command has arrived since the start
    _heard: dict[str, tuple[Health, Ns]] = field(default_factory=dict[str, tuple[Health, Ns]])
    _late_ns: dict[str, Ns] = field(default_factory=dict[str, Ns])  # newest late report of each
    _counted_ns: dict[str, Ns] = field(default_factory=dict[str, Ns])  # event → newest count of it

    def ping(self, now: Ns) -> None:
        """Something that is not from the pilot arrived from topside."""
        self.pinged_ns = now

    def health(self, health: Health, now: Ns) -> None:
        name, role = health.service, self.watched.get(health.service)
        if role is None:
            return
        before, self._heard[name] = self._heard.get(name), (health, now)
        if before is None:
            return  # the first second, in which it starts
        if role == "motion" and (health.lateness_p99_ms or 0.0) > LATE_MS:
            self._late_ns[name] = now
        event = COUNTED.get(role)
        if event and health.counts.get(event.name, 0) > before[0].counts.get(event.name, 0):
            self._counted_ns[event.name] = now

    def holding(self) -> dict[str, Holding]:  # noqa: C901 - row after row
        """The conditions that hold now, by their names, in the order of the table."""
        found = dict[str, Holding]()

        def holds(condition: Condition, *about: str, level: int = 0, **numbers: float) -> None:
            found[condition.name] = Holding(level, numbers, about)

        state, newest, now, s = self.state, self.newest, self.now, self.settings
        running = state if state is not None and state.phase == "running" else None
        battery, sounder, wrench = newest.battery, newest.altimeter or newest.dvl, newest.wrench
        left = None if battery is None else battery.charge
        # After a restart in mid-dive it is as if the last command had come just before.
        self._commanded = self._commanded or self.command is not None
        waits = not self._commanded and now - self.started_ns <= TTL_MS * 1e6
        present = self.command is not None and self.command.pilot == "present"
        no_pilot = self.armed and not present and not waits

        if newest.leak is not None and newest.leak.wet:
            holds(events.LEAK)
        if left is not None and left <= s.battery_critical:
            # More than empty counts as worse, but a driver may say anything: not without end.
            level = int((s.battery_critical - max(-1.0, left)) / WORSE)
            holds(events.BATTERY_CRITICAL, level=level, left=round(max(0.0, left), 2))
        if state is None:
            holds(events.STATE_LOST)
        if running is not None and not running.roll.valid:
            holds(events.IMU_LOST)
        pinged_ns = None if self.command is not None else self.pinged_ns
        if no_pilot and pinged_ns is not None and now - pinged_ns > LINK_PATIENCE_NS:
            holds(events.LINK_LOST)
        if no_pilot:
            holds(events.PILOT_LOST)
        if self.limited:
            holds(events.DEPTH_LIMIT, m=s.depth_limit)
        deepest = s.depth_limit + TOO_DEEP
        if running is not None and running.depth.valid and running.depth.value > deepest:
            holds(events.TOO_DEEP, m=s.depth_limit)
        altitude = None if sounder is None else sounder.altitude
        if self.above_floor:
            holds(events.FLOOR_LIMIT, m=s.floor_distance)
        elif altitude is not None and altitude < s.floor_distance:
            holds(events.NEAR_FLOOR, m=round(altitude, 1))
        if "depth" in self.unheld:
            holds(events.DEPTH_LOST)
        if "heading" in self.unheld:
            holds(events.HEADING_LOST)
        # Of sensors for which no other row stands: not of an IMU that is lost, nor of a pressure
        # sensor without which the depth is lost.
        if running is not None and running.troubles:
            of_others = {
                *(() if running.roll.valid else ("sensor/imu",)),
                *(() if running.depth.valid else ("sensor/pressure",)),
            }
            said = [t for t in running.troubles if t.partition(":")[2] not in of_others]
            if said:
                holds(events.SENSOR_TROUBLE, *said)
        if self.armed and wrench is not None and now - wrench.stamp_ns > CONTROL_PATIENCE_NS:
            holds(events.CONTROL_SILENT)
        if self._counted(events.SILENT_BOARD, BOARD_PATIENCE_NS):
            holds(events.BOARD_SILENT)
        silent = [n for n, (_, at) in self._heard.items() if now - at > HEALTH_PATIENCE_NS]
        if needed := [n for n in silent if self.watched[n] in ("motion", "keeper")]:
            holds(events.SERVICE_SILENT, *needed)
        if late := [
            n for n, at in self._late_ns.items() if n not in silent and now - at < RECENT_NS
        ]:
            holds(events.SERVICE_LATE, *late)
        if any(self.watched[name] == "recorder" for name in silent):
            holds(events.RECORDER_DOWN)
        if self._counted(events.DISK_ERROR, RECENT_NS):
            holds(events.DISK_FULL)
        if self._counted(events.JUMPED_CLOCK, RECENT_NS):
            holds(events.CLOCK_JUMP)
        if left is not None and s.battery_critical < left <= s.battery_low:
            holds(events.BATTERY_LOW, left=round(left, 2))
        if newest.temperature is not None and newest.temperature.temperature >= s.hot:
            holds(events.TOO_HOT, celsius=round(newest.temperature.temperature))
        return found

    @property
    def unknown(self) -> tuple[str, ...]:
        """Conditions of which nothing is known: their sensor has said nothing since the start."""
        leak, battery = self.newest.leak, self.newest.battery
        no_leak = (events.LEAK.name,) if leak is None or leak.wet is None else ()
        return no_leak if battery else (*no_leak, events.BATTERY_CRITICAL.name)

    def _counted(self, event: events.Row, within: Ns) -> bool:
        return self.now - self._counted_ns.get(event.name, -within) < within


# The table.


class FailsafeStage(NamedTuple):
    after: float  # [s] since the condition began, without a break
    reaction: Reaction


NOTICE, LIMIT = FailsafeStage(0.0, "notice"), FailsafeStage(0.0, "limit")
STOP = FailsafeStage(0.0, "stop")


@dataclass(frozen=True, slots=True)
class FailsafeRow:
    """What one condition makes the drone do."""

    condition: Condition
    measured: str  # when it holds (`ConditionWatch.holding`), for the documentation
    stages: tuple[FailsafeStage, ...] = (NOTICE,)
    overrule: bool = False  # `resume` is granted although the condition still holds
    brief: bool = False  # after a short one, centred sticks are enough
    told: bool = True  # its beginning is counted and logged here; False: by whoever measures it

    name: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.condition.name)

    @property
    def acts(self) -> bool:
        """Can it take the sticks from the pilot?"""
        return any(stage.reaction in ACTING for stage in self.stages)


def table(s: FailsafeSettings) -> tuple[FailsafeRow, ...]:
    """The rows, the gravest first: of equal reactions the first one is said to act."""
    rises_without_pilot = FailsafeStage(s.pilot_patience, "ascend")
    return (
        FailsafeRow(
            events.LEAK,
            "`sensor/leak` is wet",
            (NOTICE, FailsafeStage(s.leak_patience, "ascend")),
            overrule=True,
        ),
        FailsafeRow(
            events.BATTERY_CRITICAL,
            "`sensor/battery`: charge left at most `battery_critical`",
            (NOTICE, FailsafeStage(s.battery_patience, "ascend")),
            overrule=True,
        ),
        FailsafeRow(events.STATE_LOST, "no `state` for 0.1 s", (STOP,), brief=True),
        FailsafeRow(events.IMU_LOST, "`state`: roll is not valid", (STOP,), overrule=True),
        FailsafeRow(
            events.LINK_LOST,
            "neither sticks nor `clock/ping` for 1 s, after there were pings",
            (STOP, rises_without_pilot),
            brief=True,
        ),
        FailsafeRow(
            events.PILOT_LOST,
            "armed, and the newest `pilot/command` has expired (0.3 s), or its pad is lost",
            (STOP, rises_without_pilot),
            brief=True,
        ),
        FailsafeRow(events.DEPTH_LIMIT, "the reference comes to rest at `depth_limit`", (LIMIT,)),
        FailsafeRow(events.TOO_DEEP, "`state`: depth more than 0.5 m below `depth_limit`"),
        FailsafeRow(
            events.FLOOR_LIMIT,
            "the stick points down in a mode that holds the depth, and the reference comes to rest "
            "at `floor_distance`",
            (LIMIT,),
        ),
        FailsafeRow(
            events.NEAR_FLOOR,
            "`sensor/dvl` or `sensor/altitude`: altitude less than `floor_distance`",
        ),
        FailsafeRow(
            events.DEPTH_LOST,
            "the mode holds the depth, and its estimate is not valid for 0.5 s",
            told=False,
        ),
        FailsafeRow(
            events.HEADING_LOST,
            "the mode holds the heading, and its estimate is not valid for 0.5 s",
            told=False,
        ),
        FailsafeRow(
            events.SENSOR_TROUBLE,
            "`state`: troubles, by estimation (silent, noisy, frozen, inconsistent, disturbed)",
            told=False,
        ),
        FailsafeRow(events.CONTROL_SILENT, "armed, and no `control/wrench` for 0.5 s"),
        FailsafeRow(
            events.BOARD_SILENT,
            "`health` of a driver such as ardusub: no heartbeat of the board for 3 s",
            told=False,
        ),
        FailsafeRow(
            events.SERVICE_SILENT,
            "no `health` of the vehicle side, estimation, control, a module of yours on board or, "
            "where it is another machine, its supervisor for 3 s, after there was some",
        ),
        FailsafeRow(
            events.SERVICE_LATE,
            "`health` of the vehicle side, estimation, control or a module of yours on board: 1 % "
            "of its messages of a second handled over 40 ms late, in the last 10 s",
        ),
        FailsafeRow(
            events.RECORDER_DOWN, "no `health` of the recorder for 3 s, after there was some"
        ),
        FailsafeRow(
            events.DISK_FULL,
            "`health` of the recorder: a disk error in the last 10 s",
            told=False,
        ),
        FailsafeRow(
            events.CLOCK_JUMP, "`health` of the link monitor: a jump in the last 10 s", told=False
        ),
        FailsafeRow(
            events.BATTERY_LOW,
            "`sensor/battery`: charge left at most `battery_low`, and more than `battery_critical`",
        ),
        FailsafeRow(events.TOO_HOT, "`sensor/temperature`: at least `hot`"),
    )
