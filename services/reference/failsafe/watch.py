"""Which conditions hold: from what the vehicle and the services say on the bus.

Each message is taken in as it arrives or as the newest one; `holding` judges them at each step.
"""

from dataclasses import dataclass, field

from messages.control import Wrench
from messages.counts import sentence
from messages.health import LATE_MS, Health
from messages.pilot import TTL_MS, PilotCommand
from messages.sensors import BatterySample, DvlSample, LeakSample, TemperatureSample
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
ON_BOARD = ("simulator", "estimation", "control")  # services that the motion depends on
TIMED = ("simulator", "estimation", "control")  # their lateness is that of the motion
RECORDERS = ("recorder", "recorder_drone")
CLOCKS = ("link_monitor",)
BOARDS = ("ardusub",)  # drivers of a board with a life of its own
BOARD_PATIENCE_NS = 2_500_000_000  # [ns] without a count of a silent board, of one a second


@dataclass(frozen=True, slots=True)
class Newest:
    """The newest message of each vehicle-side topic; None: none yet, or not fresh."""

    wrench: Wrench | None = None
    battery: BatterySample | None = None
    leak: LeakSample | None = None
    temperature: TemperatureSample | None = None
    dvl: DvlSample | None = None


NOTHING = Newest()


@dataclass(slots=True)
class ConditionWatch:
    settings: FailsafeSettings
    started_ns: Ns = 0  # [ns] now, when this was made
    newest: Newest = NOTHING  # the service's, before each step
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
        if name not in (*ON_BOARD, *RECORDERS, *CLOCKS, *BOARDS):
            return
        self._health[name], self._healthy_ns[name] = health, now
        if before is None:
            return  # the first second, in which it starts
        if name in TIMED and _late(health):
            self._late_ns[name] = now
        if name in RECORDERS and _more("disk_error", health, before):
            self._disk_error_ns = now
        if name in CLOCKS and _more("jumped:clock", health, before):
            self._clock_jump_ns = now
        if name in BOARDS and _more("silent:board", health, before):
            self._board_silent_ns = now

    def holding(
        self,
        state: VehicleState | None,
        command: PilotCommand | None,
        unheld: tuple[str, ...],
        now: Ns,
        *,
        armed: bool,
        limited: bool,
    ) -> dict[str, Holding]:
        """The conditions that hold now.

        Args:
            state, command: the newest fresh ones.
            unheld: axes that the mode holds, but whose estimates are not valid.
            limited: the reference comes to rest at the depth limit.
        """
        holds: dict[str, Holding] = {}
        self._pilot(holds, command, now, armed=armed)
        self._motion(holds, state, now, armed=armed)
        for axis in unheld:
            holds[f"{axis}_lost"] = Holding()
        if limited:
            holds["depth_limit"] = Holding(detail=f"{self.settings.depth_limit:g} m")
        self._vehicle(holds)
        if self._health:
            self._services(holds, now)
        return holds

    @property
    def unknown(self) -> tuple[str, ...]:
        """Conditions of which nothing is known: their sensor has said nothing since the start."""
        newest = self.newest
        leak = () if newest.leak is not None and newest.leak.wet is not None else ("leak",)
        return leak if newest.battery is not None else (*leak, "battery_critical")

    def _pilot(
        self, holds: dict[str, Holding], command: PilotCommand | None, now: Ns, *, armed: bool
    ) -> None:
        self._commanded = self._commanded or command is not None
        if not armed or (command is not None and command.pilot == "present"):
            return
        if not self._commanded and now - self.started_ns <= TTL_MS * 1e6:
            return  # restarted in mid-dive: as if the last command had come just before
        holds["pilot_lost"] = Holding()
        pinged = self._pinged_ns
        if command is None and pinged is not None and now - pinged > LINK_PATIENCE_NS:
            holds["link_lost"] = Holding()

    def _motion(
        self, holds: dict[str, Holding], state: VehicleState | None, now: Ns, *, armed: bool
    ) -> None:
        if state is None:
            holds["state_lost"] = Holding()
        elif state.phase == "running":
            if not state.roll.valid:
                holds["imu_lost"] = Holding()
            if others := _unsaid(state):
                holds["sensor"] = Holding(detail=", ".join(map(sentence, others)))
            if state.depth.valid and state.depth.value > self.settings.depth_limit + TOO_DEEP:
                holds["too_deep"] = Holding(detail=f"{self.settings.depth_limit:g} m")
        wrench = self.newest.wrench
        if wrench is None:
            return
        if wrench.distrusted:
            holds["thruster"] = Holding(detail=", ".join(wrench.distrusted))
        if armed and now - wrench.stamp_ns > CONTROL_PATIENCE_NS:
            holds["control_silent"] = Holding()

    def _vehicle(self, holds: dict[str, Holding]) -> None:
        newest, s = self.newest, self.settings
        if newest.leak is not None and newest.leak.wet:
            holds["leak"] = Holding()
        if newest.battery is not None and (left := charge_left(newest.battery)) is not None:
            said = f"{max(0.0, left):.0%} left"
            if left <= s.battery_critical:
                holds["battery_critical"] = Holding(int((s.battery_critical - left) / WORSE), said)
            elif left <= s.battery_low:
                holds["battery_low"] = Holding(detail=said)
        if newest.temperature is not None and newest.temperature.temperature >= s.hot:
            holds["too_hot"] = Holding(detail=f"{newest.temperature.temperature:.0f} °C")
        altitude = None if newest.dvl is None else newest.dvl.altitude
        if altitude is not None and altitude < s.floor_distance:
            holds["near_floor"] = Holding(detail=f"{altitude:.1f} m")

    def _services(self, holds: dict[str, Holding], now: Ns) -> None:
        silent = [n for n, at in self._healthy_ns.items() if now - at > HEALTH_PATIENCE_NS]
        if stopped := [name for name in silent if name in ON_BOARD]:
            holds["service_silent"] = Holding(detail=", ".join(stopped))
        board = self._board_silent_ns
        if board is not None and now - board < BOARD_PATIENCE_NS:
            holds["board_silent"] = Holding()
        if any(name in RECORDERS for name in silent):
            holds["recorder_down"] = Holding()
        late = [n for n, at in self._late_ns.items() if n not in silent and now - at < RECENT_NS]
        if late:
            holds["service_late"] = Holding(detail=", ".join(late))
        if self._disk_error_ns is not None and now - self._disk_error_ns < RECENT_NS:
            holds["disk_full"] = Holding()
        if self._clock_jump_ns is not None and now - self._clock_jump_ns < RECENT_NS:
            holds["clock_jump"] = Holding()


def charge_left(battery: BatterySample) -> float | None:
    """[-] -1 … 1, below 0 where more was used than it should hold; None where the driver does not
    know the capacity."""
    capacity = battery.capacity_wh
    # More than empty counts as worse, but a driver may say anything: not without end.
    return None if not capacity else max(-1.0, 1.0 - battery.used_wh / capacity)


def _unsaid(state: VehicleState) -> list[str]:
    """Troubles of sensors for which no other row stands: not of an IMU that is lost, nor of a
    pressure sensor without which the depth is lost."""
    named = [
        *([] if state.roll.valid else ["sensor/imu"]),
        *([] if state.depth.valid else ["sensor/pressure"]),
    ]
    return [name for name in state.troubles or () if name.partition(":")[2] not in named]


def _more(count: str, health: Health, before: Health) -> bool:
    """Was it counted again since then?"""
    return health.counts.get(count, 0) > before.counts.get(count, 0)


def _late(health: Health) -> bool:
    late = health.lateness_p99_ms
    return late is not None and late > LATE_MS
