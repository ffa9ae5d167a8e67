"""The simulator's thinking: commands in, samples and the truth out, time passed in.

The world moves only when told to what time; in between nothing happens. A thruster command takes
effect at the very instant it is heard, and ends at the very instant its time-to-live does. What
is broken is broken between the world and its messages: the truth stays the truth.
"""

from typing import TypeVar

from messages.control import ThrusterCommand
from messages.message import Message
from messages.sensors import (
    BatterySample,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.simulator import FaultRequest
from messages.units import Vec3
from messages.vehicle import Actuation, Truth
from services.marine.attitude import heading_of, to_euler, to_world, wrapped
from services.marine.mounting import Mount, Placed
from services.marine.vehicle import Vehicle
from services.simulator import faults
from services.simulator.battery import Battery
from services.simulator.sensors import Sensors
from services.simulator.settings import Dvl, Usbl
from services.simulator.settings import Settings as Settings
from services.simulator.vessel import Vessel
from services.simulator.world import WorldCheckpoint as WorldCheckpoint
from services.simulator.world import at_the_surface as at_the_surface
from services.vehicle.actuator_gate import ActuatorGate
from services.vehicle.mounting import place_of

M = TypeVar("M", bound=Message)


class Simulator:
    def __init__(
        self, vehicle: Vehicle, settings: Settings, seed: int, world: WorldCheckpoint
    ) -> None:
        """Time begins with the first `advance` or `obey`.

        Args:
            seed: [-] 0 or more, of biases and noise.
            world: where to begin, see `at_the_surface`.

        Raises:
            ValueError: a thruster without direction, or a negative seed.
        """
        self._vessel = Vessel(vehicle, settings, world.state, world.thrust, seed)
        self._sensors = Sensors(settings, seed, vehicle.mounting)
        self._mounting = vehicle.mounting
        self._settings = settings
        self._battery = Battery(vehicle, settings, world.used_wh)
        self._heading = world.heading
        self._faults: faults.Faults = {}
        self._said: dict[str, Message] = {}  # first sample of each sensor since it has a fault
        self._set_faults(world.faults)
        self._now = 0  # [ns] to which the world has moved
        self._begun = False
        self._gate = ActuatorGate(vehicle.thruster)

    # Time and commands. Each returns the names of what is to be counted.

    def advance(self, now: int) -> list[str]:
        """Move the world to `now` [ns]."""
        ends = self._gate.ends_ns
        if ends is None or now <= ends:
            self._move(now)
            return []
        self._move(max(self._now, ends))
        counted = self._gate.lapse(now)
        self._vessel.drive(self._gate.output(now))
        self._move(now)
        return counted

    def obey(self, command: ThrusterCommand, now: int) -> list[str]:
        """Let a command take effect at `now` [ns], until then the old one holds."""
        counted = [*self.advance(now), *self._gate.obey(command, now)]
        if self._gate.command is command:
            self._vessel.drive(self._gate.output(now))
        return counted

    # Faults.

    @property
    def thrusters(self) -> list[str]:
        return [thruster.name for thruster in self._vessel.vehicle.thruster]

    @property
    def sensors(self) -> list[str]:
        """Keys of those the vehicle has."""
        missing = {"sensor/dvl": self._settings.dvl, "sensor/usbl": self._settings.usbl}
        return [key for key in faults.MEASURED if missing.get(key, True) is not None]

    @property
    def silent(self) -> list[str]:
        """Keys of the sensors that a fault keeps silent."""
        return [key for key, fault in self._faults.items() if fault.kind == "silent"]

    def refusal(self, request: FaultRequest) -> str:
        """Why a request for a part that exists cannot be granted; empty when it can."""
        return faults.refusal(request, self.thrusters)

    def break_or_mend(self, request: FaultRequest, now: int) -> list[str]:
        """Grant a request at `now` [ns]; returns the names of what is to be counted."""
        counted = self.advance(now)
        names, settles_at = self.thrusters, self._vessel.settles_at
        newtons = settles_at[names.index(request.part)] if request.part in names else 0.0
        self._set_faults(faults.changed(self._faults, request, newtons))
        return counted

    def _set_faults(self, those: faults.Faults) -> None:
        old, self._faults = self._faults, those
        self._told = tuple(f"{part}: {fault}" for part, fault in those.items())
        self._vessel.set_faults(those)
        self._sensors.noise_times = {
            key: fault.value for key, fault in those.items() if fault.kind == "noisy"
        }
        for key in [key for key in self._said if those.get(key) != old.get(key)]:
            del self._said[key]

    def _says(self, key: str, sample: M) -> M | None:
        """What a sensor says instead of its sample; None when it keeps silent."""
        if key not in self._faults:
            return sample
        first = self._said.setdefault(key, sample)
        return faults.said(key, sample, self._faults[key], first)

    def _move(self, now: int) -> None:
        if not self._begun:
            self._begun, self._now = True, now
        if now <= self._now:
            return
        seconds = (now - self._now) / 1e9
        self._vessel.advance(seconds)
        self._battery.feed(self._vessel.produced, seconds)
        heading = heading_of(self._vessel.attitude)
        self._heading += wrapped(heading - self._heading)
        self._now = now

    # What can be measured now; None where a sensor keeps silent.

    def imu(self) -> ImuSample | None:
        """Through the water as over the ground: a steady current accelerates nothing."""
        ship = self._vessel
        sample = self._sensors.imu(self._now, ship.attitude, ship.through_water, ship.acceleration)
        return self._says("sensor/imu", sample)

    def magnetometer(self) -> MagnetometerSample | None:
        sample = self._sensors.magnetometer(self._now, self._vessel.attitude)
        return self._says("sensor/magnetometer", sample)

    def pressure(self) -> PressureSample | None:
        sample = self._sensors.pressure(self._now, self._place(self._mounting.pressure)[2])
        return self._says("sensor/pressure", sample)

    def dvl(self, device: Dvl) -> DvlSample | None:
        """None also when the bottom is out of reach."""
        altitude = self._settings.floor_depth - self._place(self._mounting.dvl)[2]
        sample = self._sensors.dvl(self._now, self._vessel.velocity, altitude, device)
        return None if sample is None else self._says("sensor/dvl", sample)

    def usbl(self, device: Usbl) -> UsblSample | None:
        north, east, _ = self._place(self._mounting.usbl)
        return self._says("sensor/usbl", self._sensors.usbl(self._now, north, east, device))

    def _place(self, mount: Placed | Mount) -> Vec3:
        """[m] NED, where a sensor is."""
        return place_of(mount.position, self._vessel.position, self._vessel.attitude)

    def battery(self) -> BatterySample | None:
        return self._says("sensor/battery", self._battery.sample(self._now))

    @property
    def battery_empty(self) -> bool:
        return self._battery.empty

    def actuation(self) -> Actuation:
        cause = self._gate.command
        return Actuation(
            stamp_ns=self._now,
            thrust=tuple(self._vessel.produced),
            measured=True,
            actuated_ns=self._gate.obeyed_ns,
            sensor_ns=cause.sensor_ns if cause else None,
            pilot_ns=cause.pilot_ns if cause else None,
            stale=self._gate.ends_ns is None,
            power=self._battery.power,
        )

    def truth(self) -> Truth:
        u, v, w, p, q, r = self._vessel.velocity
        attitude = self._vessel.attitude
        roll, pitch, _ = to_euler(attitude)
        return Truth(
            stamp_ns=self._now,
            position=self._vessel.position,
            attitude=attitude,
            velocity=(u, v, w),
            angular_rate=(p, q, r),
            depth_rate=to_world(attitude, (u, v, w))[2],
            roll=roll,
            pitch=pitch,
            heading=self._heading,
            on_floor=self._vessel.on_floor,
            current=self._vessel.current,
            tether_pull=self._vessel.tether_pull,
            faults=self._told,
        )

    def world(self) -> WorldCheckpoint:
        """What to remember."""
        return WorldCheckpoint(
            state=self._vessel.state,
            thrust=tuple(self._vessel.thrust),
            heading=self._heading,
            used_wh=self._battery.used_wh,
            faults=dict(self._faults),
        )
