"""The simulator's thinking: commands in, samples and the truth out, time passed in.

The world moves only when told to what time; in between nothing happens. A thruster command takes
effect at the very instant it is heard, and ends at the very instant its time-to-live does.
"""

import msgspec

from messages.control import ThrusterCommand
from messages.message import Finite, Positive
from messages.sensors import (
    BatterySample,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.vehicle import Actuation, Truth
from services.marine.attitude import from_euler, to_euler, to_world, wrapped
from services.marine.vehicle import Vehicle
from services.simulator.battery import Battery
from services.simulator.sensors import Sensors
from services.simulator.settings import Dvl, Usbl
from services.simulator.settings import Settings as Settings
from services.simulator.vessel import Vessel

THRUSTERS = "control/thrusters"  # named in what is counted


class World(msgspec.Struct, frozen=True):
    """All that must survive a restart in mid-dive."""

    state: tuple[Finite, ...]  # 13 numbers, see vessel.State
    thrust: tuple[Finite, ...]  # [N] per thruster
    heading: Finite  # [rad] accumulated past ±π
    used_wh: Positive  # [Wh]

    def fits(self, vehicle: Vehicle) -> bool:
        return len(self.state) == 13 and len(self.thrust) == len(vehicle.thruster)


def at_the_surface(vehicle: Vehicle, settings: Settings) -> World:
    """At rest, floating, level.

    Raises:
        ValueError: the sea is too shallow for the vehicle.
    """
    depth = vehicle.floating_depth
    keel = depth + vehicle.size[2] / 2
    if settings.floor_depth <= keel:
        raise ValueError(
            f"simulator.floor_depth: found {settings.floor_depth} m, but the vehicle floats with "
            f"its bottom at {keel:.2f} m; must be more"
        )
    attitude = from_euler(0.0, 0.0, settings.start_heading)
    return World(
        state=(0.0, 0.0, depth, *attitude, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        thrust=(0.0,) * len(vehicle.thruster),
        heading=settings.start_heading,
        used_wh=0.0,
    )


class Simulator:
    def __init__(self, vehicle: Vehicle, settings: Settings, seed: int, world: World) -> None:
        """Time begins with the first `advance` or `obey`.

        Args:
            seed: [-] 0 or more, of biases and noise.
            world: where to begin, see `at_the_surface`.

        Raises:
            ValueError: a thruster without direction, or a negative seed.
        """
        self._vessel = Vessel(
            vehicle, settings.floor_depth, settings.wake_share, world.state, world.thrust
        )
        self._sensors = Sensors(settings, seed)
        self._floor_depth = settings.floor_depth
        self._battery = Battery(vehicle, settings, world.used_wh)
        self._heading = world.heading
        self._now = 0  # [ns] to which the world has moved
        self._begun = False
        self._command: ThrusterCommand | None = None  # the newest that took effect
        self._actuated_ns: int | None = None
        self._ends_ns: int | None = None  # the instant it becomes stale; None: nothing to obey

    # Time and commands. Each returns the names of what is to be counted.

    def advance(self, now: int) -> list[str]:
        """Move the world to `now` [ns]."""
        if self._ends_ns is None or now <= self._ends_ns:
            self._move(now)
            return []
        self._move(max(self._now, self._ends_ns))
        self._ends_ns = None
        self._vessel.drive([0.0] * len(self._vessel.thrust))
        self._move(now)
        return [f"stale:{THRUSTERS}"]

    def obey(self, command: ThrusterCommand, now: int) -> list[str]:
        """Let a command take effect at `now` [ns], until then the old one holds."""
        counted = self.advance(now)
        if len(command.thrust) != len(self._vessel.thrust):
            return [*counted, f"wrong_length:{THRUSTERS}"]
        limited = self._vessel.drive(command.thrust)
        self._command, self._actuated_ns = command, now
        self._ends_ns = command.stamp_ns + round(command.ttl_ms * 1e6)
        return [*counted, *(f"saturated:{name}" for name in limited)]

    def _move(self, now: int) -> None:
        if not self._begun:
            self._begun, self._now = True, now
        if now <= self._now:
            return
        seconds = (now - self._now) / 1e9
        self._vessel.advance(seconds)
        self._battery.feed(self._vessel.produced, seconds)
        heading = to_euler(self._attitude)[2]
        self._heading += wrapped(heading - self._heading)
        self._now = now

    # What can be measured now.

    def imu(self) -> ImuSample:
        return self._sensors.imu(
            self._now, self._attitude, self._velocity, self._vessel.acceleration
        )

    def magnetometer(self) -> MagnetometerSample:
        return self._sensors.magnetometer(self._now, self._attitude)

    def pressure(self) -> PressureSample:
        return self._sensors.pressure(self._now, self._vessel.state[2])

    def dvl(self, device: Dvl) -> DvlSample | None:
        """None when the bottom is out of reach."""
        u, v, w, *_ = self._velocity
        altitude = self._floor_depth - self._vessel.state[2]
        return self._sensors.dvl(self._now, (u, v, w), altitude, device)

    def usbl(self, device: Usbl) -> UsblSample:
        north, east, *_ = self._vessel.state
        return self._sensors.usbl(self._now, north, east, device)

    def battery(self) -> BatterySample:
        return self._battery.sample(self._now)

    @property
    def battery_empty(self) -> bool:
        return self._battery.empty

    def actuation(self) -> Actuation:
        cause = self._command
        return Actuation(
            stamp_ns=self._now,
            thrust=tuple(self._vessel.produced),
            actuated_ns=self._actuated_ns,
            sensor_ns=cause.sensor_ns if cause else None,
            pilot_ns=cause.pilot_ns if cause else None,
            stale=self._ends_ns is None,
            power=self._battery.power,
        )

    def truth(self) -> Truth:
        x, y, z, *_ = self._vessel.state
        u, v, w, p, q, r = self._velocity
        attitude = self._attitude
        roll, pitch, _ = to_euler(attitude)
        return Truth(
            stamp_ns=self._now,
            position=(x, y, z),
            attitude=attitude,
            velocity=(u, v, w),
            angular_rate=(p, q, r),
            depth_rate=to_world(attitude, (u, v, w))[2],
            roll=roll,
            pitch=pitch,
            heading=self._heading,
            on_floor=self._vessel.on_floor,
        )

    def world(self) -> World:
        """What to remember."""
        return World(
            state=self._vessel.state,
            thrust=tuple(self._vessel.thrust),
            heading=self._heading,
            used_wh=self._battery.used_wh,
        )

    @property
    def _attitude(self) -> tuple[float, float, float, float]:
        _, _, _, w, x, y, z, *_ = self._vessel.state
        return w, x, y, z

    @property
    def _velocity(self) -> tuple[float, float, float, float, float, float]:
        *_, u, v, w, p, q, r = self._vessel.state
        return u, v, w, p, q, r
