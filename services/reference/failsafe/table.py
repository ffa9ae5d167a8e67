"""The failsafe table: what makes the drone act by itself, when it holds, in which stages it acts,
and what ends it. And what is known of the vehicle and its services, by which that is judged.

`docs/failsafes.md` is written from it (`make docs`).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, get_args

from messages import events
from messages.control import Wrench
from messages.events import Condition, sentence
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
    detail: str = ""  # which sensor, thruster, service …


Predicate = Callable[["ConditionWatch"], Holding | None]


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
    silent: list[str] = field(default_factory=list[str])  # services
    pinged_ns: Ns | None = None
    _commanded: bool = False  # a command has arrived since the start
    _rows: list[tuple[str, Predicate]] = field(init=False)
    _heard: dict[str, tuple[Health, Ns]] = field(default_factory=dict[str, tuple[Health, Ns]])
    _late_ns: dict[str, Ns] = field(default_factory=dict[str, Ns])  # newest late report of each
    _counted_ns: dict[str, Ns] = field(default_factory=dict[str, Ns])  # event → newest count of it

    def __post_init__(self) -> None:
        self._rows = [(row.name, row.holds) for row in table(self.settings)]

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

    def holding(self) -> dict[str, Holding]:
        """The conditions that hold now, by their names, in the order of the table."""
        self._commanded = self._commanded or self.command is not None
        self.silent = [
            n for n, (_, at) in self._heard.items() if self.now - at > HEALTH_PATIENCE_NS
        ]
        pairs = ((name, holds(self)) for name, holds in self._rows)
        return {name: found for name, found in pairs if found is not None}

    @property
    def unknown(self) -> tuple[str, ...]:
        """Conditions of which nothing is known: their sensor has said nothing since the start."""
        leak, battery = self.newest.leak, self.newest.battery
        no_leak = (events.LEAK.name,) if leak is None or leak.wet is None else ()
        return no_leak if battery else (*no_leak, events.BATTERY_CRITICAL.name)

    # What several rows ask.

    @property
    def running(self) -> VehicleState | None:
        """The state of an estimator that has begun."""
        state = self.state
        return state if state is not None and state.phase == "running" else None

    @property
    def pilot_lost(self) -> bool:
        """After a restart in mid-dive it is as if the last command had come just before."""
        present = self.command is not None and self.command.pilot == "present"
        waits = not self._commanded and self.now - self.started_ns <= TTL_MS * 1e6
        return self.armed and not present and not waits

    @property
    def charge(self) -> float | None:
        """[-] Left of the battery's. More than empty counts as worse, but a driver may say
        anything: not without end."""
        charge = None if self.newest.battery is None else self.newest.battery.charge
        return None if charge is None else max(-1.0, charge)

    def counted(self, event: events.Row, within: Ns) -> bool:
        at = self._counted_ns.get(event.name)
        return at is not None and self.now - at < within

    def silent_of(self, *roles: str) -> list[str]:
        return [name for name in self.silent if self.watched[name] in roles]

    def late(self) -> list[str]:
        late = self._late_ns.items()
        return [n for n, at in late if n not in self.silent and self.now - at < RECENT_NS]


# When each condition holds, and what is to be said of it.


def _if(holds: bool, detail: str = "") -> Holding | None:
    return Holding(detail=detail) if holds else None


def _named(names: Iterable[str]) -> Holding | None:
    detail = ", ".join(names)
    return Holding(detail=detail) if detail else None


def _link_lost(seen: ConditionWatch) -> Holding | None:
    pinged = seen.pinged_ns
    quiet = pinged is not None and seen.now - pinged > LINK_PATIENCE_NS
    return _if(seen.command is None and quiet and seen.pilot_lost)


def _battery_critical(seen: ConditionWatch) -> Holding | None:
    left, critical = seen.charge, seen.settings.battery_critical
    if left is None or left > critical:
        return None
    return Holding(int((critical - left) / WORSE), f"{max(0.0, left):.0%} left")


def _battery_low(seen: ConditionWatch) -> Holding | None:
    left, s = seen.charge, seen.settings
    if left is None or not s.battery_critical < left <= s.battery_low:
        return None
    return Holding(detail=f"{left:.0%} left")


def _too_deep(seen: ConditionWatch) -> Holding | None:
    state, limit = seen.running, seen.settings.depth_limit
    deep = state is not None and state.depth.valid and state.depth.value > limit + TOO_DEEP
    return _if(deep, f"{limit:g} m")


def _near_floor(seen: ConditionWatch) -> Holding | None:
    sounder = seen.newest.altimeter or seen.newest.dvl
    altitude = None if sounder is None else sounder.altitude
    if seen.above_floor or altitude is None or altitude >= seen.settings.floor_distance:
        return None
    return Holding(detail=f"{altitude:.1f} m")


def _sensor_trouble(seen: ConditionWatch) -> Holding | None:
    """Troubles of sensors for which no other row stands: not of an IMU that is lost, nor of a
    pressure sensor without which the depth is lost."""
    if (state := seen.running) is None or not state.troubles:
        return None
    named = [
        *([] if state.roll.valid else ["sensor/imu"]),
        *([] if state.depth.valid else ["sensor/pressure"]),
    ]
    return _named(sentence(t) for t in state.troubles if t.partition(":")[2] not in named)


def _control_silent(seen: ConditionWatch) -> Holding | None:
    wrench = seen.newest.wrench
    late = wrench is not None and seen.now - wrench.stamp_ns > CONTROL_PATIENCE_NS
    return _if(seen.armed and late)


def _too_hot(seen: ConditionWatch) -> Holding | None:
    sample = seen.newest.temperature
    if sample is None or not sample.temperature >= seen.settings.hot:
        return None
    return Holding(detail=f"{sample.temperature:.0f} °C")


# The table.


class FailsafeStage(NamedTuple):
    after: float  # [s] since the condition began, without a break
    reaction: Reaction


NOTICE, LIMIT, STOP = (
    FailsafeStage(0.0, "notice"),
    FailsafeStage(0.0, "limit"),
    FailsafeStage(0.0, "stop"),
)


@dataclass(frozen=True, slots=True)
class FailsafeRow:
    """What one condition makes the drone do."""

    condition: Condition
    measured: str  # when it holds, and where that is measured; for the documentation
    holds: Predicate
    stages: tuple[FailsafeStage, ...] = (NOTICE,)
    overrule: bool = False  # `resume` is granted although the condition still holds
    brief: bool = False  # after a short one, centred sticks are enough
    told: bool = True  # its beginning is counted and logged here; False: by whoever measures it

    @property
    def name(self) -> str:
        return self.condition.name

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
            lambda seen: _if(seen.newest.leak is not None and bool(seen.newest.leak.wet)),
            (NOTICE, FailsafeStage(s.leak_patience, "ascend")),
            overrule=True,
        ),
        FailsafeRow(
            events.BATTERY_CRITICAL,
            "`sensor/battery`: charge left at most `battery_critical`",
            _battery_critical,
            (NOTICE, FailsafeStage(s.battery_patience, "ascend")),
            overrule=True,
        ),
        FailsafeRow(
            events.STATE_LOST,
            "no `state` for 0.1 s",
            lambda seen: _if(seen.state is None),
            (STOP,),
            brief=True,
        ),
        FailsafeRow(
            events.IMU_LOST,
            "`state`: roll is not valid",
            lambda seen: _if(seen.running is not None and not seen.running.roll.valid),
            (STOP,),
            overrule=True,
        ),
        FailsafeRow(
            events.LINK_LOST,
            "neither sticks nor `clock/ping` for 1 s, after there were pings",
            _link_lost,
            (STOP, rises_without_pilot),
            brief=True,
        ),
        FailsafeRow(
            events.PILOT_LOST,
            "armed, and the newest `pilot/command` has expired (0.3 s), or its pad is lost",
            lambda seen: _if(seen.pilot_lost),
            (STOP, rises_without_pilot),
            brief=True,
        ),
        FailsafeRow(
            events.DEPTH_LIMIT,
            "the reference comes to rest at `depth_limit`",
            lambda seen: _if(seen.limited, f"{s.depth_limit:g} m"),
            (LIMIT,),
        ),
        FailsafeRow(
            events.TOO_DEEP, "`state`: depth more than 0.5 m below `depth_limit`", _too_deep
        ),
        FailsafeRow(
            events.FLOOR_LIMIT,
            "the stick points down in a mode that holds the depth, and the reference comes to rest "
            "at `floor_distance`",
            lambda seen: _if(seen.above_floor, f"{s.floor_distance:g} m"),
            (LIMIT,),
        ),
        FailsafeRow(
            events.NEAR_FLOOR,
            "`sensor/dvl` or `sensor/altitude`: altitude less than `floor_distance`",
            _near_floor,
        ),
        FailsafeRow(
            events.DEPTH_LOST,
            "the mode holds the depth, and its estimate is not valid for 0.5 s",
            lambda seen: _if("depth" in seen.unheld),
            told=False,
        ),
        FailsafeRow(
            events.HEADING_LOST,
            "the mode holds the heading, and its estimate is not valid for 0.5 s",
            lambda seen: _if("heading" in seen.unheld),
            told=False,
        ),
        FailsafeRow(
            events.SENSOR_TROUBLE,
            "`state`: troubles, by estimation (silent, noisy, frozen, inconsistent, disturbed)",
            _sensor_trouble,
            told=False,
        ),
        FailsafeRow(
            events.CONTROL_SILENT, "armed, and no `control/wrench` for 0.5 s", _control_silent
        ),
        FailsafeRow(
            events.BOARD_SILENT,
            "`health` of a driver such as ardusub: no heartbeat of the board for 3 s",
            lambda seen: _if(seen.counted(events.SILENT_BOARD, BOARD_PATIENCE_NS)),
            told=False,
        ),
        FailsafeRow(
            events.SERVICE_SILENT,
            "no `health` of the vehicle side, estimation, control, a module of yours on board or, "
            "where it is another machine, its supervisor for 3 s, after there was some",
            lambda seen: _named(seen.silent_of("motion", "keeper")),
        ),
        FailsafeRow(
            events.SERVICE_LATE,
            "`health` of the vehicle side, estimation, control or a module of yours on board: 1 % "
            "of its messages of a second handled over 40 ms late, in the last 10 s",
            lambda seen: _named(seen.late()),
        ),
        FailsafeRow(
            events.RECORDER_DOWN,
            "no `health` of the recorder for 3 s, after there was some",
            lambda seen: _if(bool(seen.silent_of("recorder"))),
        ),
        FailsafeRow(
            events.DISK_FULL,
            "`health` of the recorder: a disk error in the last 10 s",
            lambda seen: _if(seen.counted(events.DISK_ERROR, RECENT_NS)),
            told=False,
        ),
        FailsafeRow(
            events.CLOCK_JUMP,
            "`health` of the link monitor: a jump in the last 10 s",
            lambda seen: _if(seen.counted(events.JUMPED_CLOCK, RECENT_NS)),
            told=False,
        ),
        FailsafeRow(
            events.BATTERY_LOW,
            "`sensor/battery`: charge left at most `battery_low`, and more than `battery_critical`",
            _battery_low,
        ),
        FailsafeRow(events.TOO_HOT, "`sensor/temperature`: at least `hot`", _too_hot),
    )
