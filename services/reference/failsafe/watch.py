"""Which conditions hold: from what the vehicle and the services say on the bus.

Each message is taken in as it arrives or as the newest one; `holding` judges them at each step.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from messages import events
from messages.control import Wrench
from messages.events import Condition, Row, sentence
from messages.health import LATE_MS, Health
from messages.pilot import TTL_MS, PilotCommand
from messages.sensors import AltitudeSample, BatterySample, DvlSample, LeakSample, TemperatureSample
from messages.state import VehicleState
from messages.units import Ns
from services.reference.failsafe.machine import Holding
from services.reference.settings import FailsafeSettings

LINK_PATIENCE_NS = 1_000_000_000  # [ns] without sticks and pings
CONTROL_PATIENCE_NS = 500_000_000  # [ns] without a wrench
HEALTH_PATIENCE_NS = 3_000_000_000  # [ns] without a health message, of one a second
RECENT_NS = 10_000_000_000  # [ns] so long the pilot reads of an event that has no end
TOO_DEEP = 0.5  # [m] below the limit: more than a reference at the limit is overshot
WORSE = 0.04  # [-] of the battery's charge: so much less is worse
AXIS_LOST: dict[str, Condition] = {"depth": events.DEPTH_LOST, "heading": events.HEADING_LOST}
BOARD_PATIENCE_NS = 2_500_000_000  # [ns] without a count of a silent board, of one a second


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


@dataclass(slots=True)
class ConditionWatch:
    settings: FailsafeSettings
    watched: Mapping[str, str] = field(default_factory=dict[str, str])  # service → its role
    started_ns: Ns = 0  # [ns] now, when this was made
    newest: WatchedMessages = NO_MESSAGES  # the service's, before each step
    _commanded: bool = False  # a command has arrived since the start
    _pinged_ns: Ns | None = None
    _health: dict[str, Health] = field(default_factory=dict[str, Health])
    _healthy_ns: dict[str, Ns] = field(default_factory=dict[str, Ns])
    _late_ns: dict[str, Ns] = field(default_factory=dict[str, Ns])  # newest late report of each
    _disk_error_ns: Ns | None = None
    _clock_jump_ns: Ns | None = None
    _board_silent_ns: Ns | None = None

    def ping(self, now: Ns) -> None:
        """Something that is not from the pilot arrived from topside."""
        self._pinged_ns = now

    def health(self, health: Health, now: Ns) -> None:
        name, before = health.service, self._health.get(health.service)
        if (role := self.watched.get(name)) is None:
            return
        self._health[name], self._healthy_ns[name] = health, now
        if before is None:
            return  # the first second, in which it starts
        if role == "motion" and _late(health):
            self._late_ns[name] = now
        if role == "motion" and _more(events.SILENT_BOARD, health, before):  # a board's own life
            self._board_silent_ns = now
        if role == "recorder" and _more(events.DISK_ERROR, health, before):
            self._disk_error_ns = now
        if role == "clock" and _more(events.JUMPED_CLOCK, health, before):
            self._clock_jump_ns = now

    def holding(  # noqa: C901 - the rows of the table one after the other
        self,
        state: VehicleState | None,
        command: PilotCommand | None,
        unheld: tuple[str, ...],
        now: Ns,
        *,
        armed: bool,
        limited: bool,
        above_floor: bool,
    ) -> dict[str, Holding]:
        """The conditions that hold now.

        Args:
            state, command: the newest fresh ones.
            unheld: axes that the mode holds, but whose estimates are not valid.
            limited: the reference comes to rest at the depth limit.
            above_floor: it comes to rest above the bottom, although the stick points down.
        """
        holds: dict[str, Holding] = {}
        newest, s = self.newest, self.settings

        # The pilot. After a restart in mid-dive it is as if the last command had come just before.
        self._commanded = self._commanded or command is not None
        piloted = command is not None and command.pilot == "present"
        waits = not self._commanded and now - self.started_ns <= TTL_MS * 1e6
        if armed and not piloted and not waits:
            holds[events.PILOT_LOST.name] = Holding()
            pinged = self._pinged_ns
            if command is None and pinged is not None and now - pinged > LINK_PATIENCE_NS:
                holds[events.LINK_LOST.name] = Holding()

        # What is known of the motion, and who controls it.
        if state is None:
            holds[events.STATE_LOST.name] = Holding()
        elif state.phase == "running":
            if not state.roll.valid:
                holds[events.IMU_LOST.name] = Holding()
            if state.troubles and (others := _unsaid(state)):
                holds[events.SENSOR_TROUBLE.name] = Holding(detail=", ".join(map(sentence, others)))
            if state.depth.valid and state.depth.value > s.depth_limit + TOO_DEEP:
                holds[events.TOO_DEEP.name] = Holding(detail=f"{s.depth_limit:g} m")
        wrench = newest.wrench
        if wrench is not None and armed and now - wrench.stamp_ns > CONTROL_PATIENCE_NS:
            holds[events.CONTROL_SILENT.name] = Holding()
        for axis in unheld:
            holds[AXIS_LOST[axis].name] = Holding()
        if limited:
            holds[events.DEPTH_LIMIT.name] = Holding(detail=f"{s.depth_limit:g} m")

        # The vehicle itself.
        if newest.leak is not None and newest.leak.wet:
            holds[events.LEAK.name] = Holding()
        if newest.battery is not None and (charge := newest.battery.charge) is not None:
            # More than empty counts as worse, but a driver may say anything: not without end.
            left = max(-1.0, charge)
            said = f"{max(0.0, left):.0%} left"
            if left <= s.battery_critical:
                worse = int((s.battery_critical - left) / WORSE)
                holds[events.BATTERY_CRITICAL.name] = Holding(worse, said)
            elif left <= s.battery_low:
                holds[events.BATTERY_LOW.name] = Holding(detail=said)
        if newest.temperature is not None and newest.temperature.temperature >= s.hot:
            holds[events.TOO_HOT.name] = Holding(detail=f"{newest.temperature.temperature:.0f} °C")
        sounder = newest.altimeter or newest.dvl
        altitude = None if sounder is None else sounder.altitude
        if above_floor:
            holds[events.FLOOR_LIMIT.name] = Holding(detail=f"{s.floor_distance:g} m")
        elif altitude is not None and altitude < s.floor_distance:
            holds[events.NEAR_FLOOR.name] = Holding(detail=f"{altitude:.1f} m")

        if self._health:
            self._services(holds, now)
        return holds

    @property
    def unknown(self) -> tuple[str, ...]:
        """Conditions of which nothing is known: their sensor has said nothing since the start."""
        leak, battery, names = self.newest.leak, self.newest.battery, list[str]()
        if leak is None or leak.wet is None:
            names.append(events.LEAK.name)
        if battery is None:
            names.append(events.BATTERY_CRITICAL.name)
        return tuple(names)

    def _services(  # noqa: C901 - as `holding`
        self, holds: dict[str, Holding], now: Ns
    ) -> None:
        silent: list[str] = []
        for name, at in self._healthy_ns.items():
            if now - at > HEALTH_PATIENCE_NS:
                silent.append(name)
        if silent:
            if stopped := [name for name in silent if self.watched[name] in ("motion", "keeper")]:
                holds[events.SERVICE_SILENT.name] = Holding(detail=", ".join(stopped))
            if any(self.watched[name] == "recorder" for name in silent):
                holds[events.RECORDER_DOWN.name] = Holding()
        board = self._board_silent_ns
        if board is not None and now - board < BOARD_PATIENCE_NS:
            holds[events.BOARD_SILENT.name] = Holding()
        if self._late_ns:
            late = [
                n for n, at in self._late_ns.items() if n not in silent and now - at < RECENT_NS
            ]
            if late:
                holds[events.SERVICE_LATE.name] = Holding(detail=", ".join(late))
        if self._disk_error_ns is not None and now - self._disk_error_ns < RECENT_NS:
            holds[events.DISK_FULL.name] = Holding()
        if self._clock_jump_ns is not None and now - self._clock_jump_ns < RECENT_NS:
            holds[events.CLOCK_JUMP.name] = Holding()


def _unsaid(state: VehicleState) -> list[str]:
    """Troubles of sensors for which no other row stands: not of an IMU that is lost, nor of a
    pressure sensor without which the depth is lost."""
    named = [
        *([] if state.roll.valid else ["sensor/imu"]),
        *([] if state.depth.valid else ["sensor/pressure"]),
    ]
    return [name for name in state.troubles or () if name.partition(":")[2] not in named]


def _more(row: Row, health: Health, before: Health) -> bool:
    """Was it counted again since then?"""
    return health.counts.get(row.name, 0) > before.counts.get(row.name, 0)


def _late(health: Health) -> bool:
    late = health.lateness_p99_ms
    return late is not None and late > LATE_MS
