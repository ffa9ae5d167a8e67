"""The simulator as a pure state machine: commands and time in, samples and ground truth out.

The simulation advances only to the times given. A thruster command takes effect exactly on arrival
and ends exactly with its time-to-live. Sensor faults change only the messages: ground truth stays
correct.
"""

from typing import TypeVar

import msgspec

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.message import Message
from messages.pilot import PilotRequest
from messages.sensors import (
    BatterySample,
    DvlSample,
    ImuSample,
    LeakSample,
    MagnetometerSample,
    PressureSample,
    TemperatureSample,
    UsblSample,
)
from messages.simulator import FaultRequest
from messages.units import Finite, NotNegative, Vec3
from messages.vehicle import Actuation, Truth, VehicleStatus
from services.marine import outputs
from services.marine.attitude import from_euler, heading_of, to_body, to_euler, to_world, wrapped
from services.marine.mounting import Mount, Placed
from services.marine.vehicle import Vehicle
from services.simulator import faults
from services.simulator.faults import Fault
from services.simulator.hull import in_the_water
from services.simulator.propulsion import Battery
from services.simulator.sensors import Sensors
from services.simulator.settings import ENCLOSURE_RISE, WATER_TEMPERATURE, Dvl, Settings, Usbl
from services.simulator.vessel import Vessel
from services.simulator.vibration import Shaking
from services.vehicle.actuation import OpenLoopThrust
from services.vehicle.actuator_gate import ActuatorGate
from services.vehicle.mounting import place_of


class WorldCheckpoint(msgspec.Struct, frozen=True):
    """State for a restart in mid-dive."""

    state: tuple[Finite, ...]  # 13 numbers, see vessel.State
    thrust: tuple[Finite, ...]  # [N] per thruster
    heading: Finite  # [rad] accumulated past ±π
    used_wh: NotNegative  # [Wh]
    faults: dict[str, Fault] = {}  # in force, by part

    def fits(self, vehicle: Vehicle) -> bool:
        return len(self.state) == 13 and len(self.thrust) == len(vehicle.thruster)


def at_the_surface(vehicle: Vehicle, settings: Settings) -> WorldCheckpoint:
    """At rest in the water, floating, level, carried along by the mean current.

    Raises:
        ValueError: the sea is too shallow for the vehicle.
    """
    vehicle = in_the_water(vehicle, settings.hull)
    depth = vehicle.floating_depth
    keel = depth + vehicle.size[2] / 2
    if settings.floor_depth <= keel:
        raise ValueError(
            f"simulator.floor_depth: found {settings.floor_depth} m, but the vehicle floats with "
            f"its bottom at {keel:.2f} m; must be more"
        )
    attitude = from_euler(0.0, 0.0, settings.start_heading)
    flow = settings.current
    carried = (0.0, 0.0, 0.0)
    if flow is not None:
        carried = to_body(attitude, (flow.north, flow.east, 0.0))
    return WorldCheckpoint(
        state=(0.0, 0.0, depth, *attitude, *carried, 0.0, 0.0, 0.0),
        thrust=(0.0,) * len(vehicle.thruster),
        heading=settings.start_heading,
        used_wh=0.0,
    )


M = TypeVar("M", bound=Message)


def sensors_of(settings: Settings) -> list[str]:
    """Keys of the sensors that a vehicle with these settings has."""
    missing = {"sensor/dvl": settings.dvl, "sensor/usbl": settings.usbl}
    return [key for key in faults.MEASURED if missing.get(key, True) is not None]


class Simulator:
    def __init__(
        self,
        vehicle: Vehicle,
        settings: Settings,
        seed: int,
        world: WorldCheckpoint,
        outbox: Outbox,
    ) -> None:
        """Time begins with the first `advance` or `obey`.

        Args:
            seed: [-] 0 or more, of biases and noise.
            world: initial state, see `at_the_surface`.

        Raises:
            ValueError: a negative seed.
        """
        self._vessel = Vessel(vehicle, settings, world.state, world.thrust, seed)
        self._mounting = settings.mounting or vehicle.mounting
        self._sensors = Sensors(settings, seed, self._mounting)
        self._shaking = None
        if settings.vibration is not None:
            self._shaking = Shaking(settings.vibration, vehicle.thruster, seed)
        self._shaken_ns: int | None = None  # [ns] of the newest IMU sample
        self._settings = settings
        self._battery = Battery(vehicle, settings, world.used_wh)
        self._heading = world.heading
        self._faults: faults.Faults = {}
        self._first: dict[str, Message] = {}  # first sample of each sensor since its fault began
        self._set_faults(world.faults)
        self._now = 0  # [ns] time of the simulation
        self._started = False
        self._gate = ActuatorGate(vehicle.thruster, outbox)
        # The drone's belief about thrusters that it does not measure.
        self._believed = OpenLoopThrust(vehicle.thruster) if settings.hull else None
        self._status: VehicleStatus | None = None  # newest heard

    # Time and commands.

    def advance(self, now: int) -> None:
        """Advance the simulation to `now` [ns]."""
        ends = self._gate.ends_ns
        if ends is not None and now > ends:
            self._move(max(self._now, ends))
            self._gate.lapse(now)
            self._drive(now)
        self._move(now)

    def obey(self, command: ThrusterCommand, now: int) -> None:
        """Apply a command at `now` [ns]; until then the previous one holds."""
        self.advance(now)
        self._gate.obey(command, now)
        if self._gate.command is command:
            self._drive(now)

    def hear(self, request: PilotRequest, now: int) -> None:
        """Take in a request of a pilot at `now` [ns]: a disarm stops the thrusters."""
        self.advance(now)
        self._gate.hear(request, now)
        self._drive(now)

    def look(self, status: VehicleStatus | None) -> None:
        """The newest status, for lights and switches; None: none yet."""
        self._status = status

    def _drive(self, now: int) -> None:
        thrust = self._gate.output(now)
        self._vessel.propulsion.drive(thrust)
        if self._believed is not None:
            self._believed.drive(thrust, now)

    # Faults.

    @property
    def thrusters(self) -> list[str]:
        return [thruster.name for thruster in self._vessel.vehicle.thruster]

    @property
    def sensors(self) -> list[str]:
        """Keys of those the vehicle has."""
        return sensors_of(self._settings)

    @property
    def silent(self) -> list[str]:
        """Keys of the sensors that a fault keeps silent."""
        return [key for key, fault in self._faults.items() if fault.kind == "silent"]

    def break_or_mend(self, request: FaultRequest, now: int) -> None:
        """Grant a request at `now` [ns]."""
        self.advance(now)
        names, settles_at = self.thrusters, self._vessel.propulsion.settles_at
        newtons = settles_at[names.index(request.part)] if request.part in names else 0.0
        self._set_faults(faults.changed(self._faults, request, newtons))

    def _set_faults(self, new: faults.Faults) -> None:
        old, self._faults = self._faults, new
        self._fault_texts = tuple(f"{part}: {fault}" for part, fault in new.items())
        self._vessel.propulsion.set_faults(new)
        self._sensors.noise_times = {
            key: fault.value for key, fault in new.items() if fault.kind == "noisy"
        }
        for key in [key for key in self._first if new.get(key) != old.get(key)]:
            del self._first[key]

    def _with_fault(self, key: str, sample: M) -> M | None:
        """The sample with the sensor's fault, if any; None when it is silent."""
        if key not in self._faults:
            return sample
        first = self._first.setdefault(key, sample)
        return faults.faulty(key, sample, self._faults[key], first)

    def _move(self, now: int) -> None:
        if not self._started:
            self._started, self._now = True, now
        if now <= self._now:
            return
        seconds = (now - self._now) / 1e9
        self._vessel.advance(seconds)
        self._battery.feed(self._vessel.propulsion.produced, seconds)
        heading = heading_of(self._vessel.attitude)
        self._heading += wrapped(heading - self._heading)
        self._now = now

    # Samples now; None where a sensor is silent.

    def imu(self) -> ImuSample | None:
        """From the motion through the water: a steady current causes no acceleration."""
        v = self._vessel
        shaken = None
        if self._shaking is not None:
            dt = 0.0 if self._shaken_ns is None else (self._now - self._shaken_ns) * 1e-9
            shaken, self._shaken_ns = self._shaking.step(v.propulsion.produced, dt), self._now
        sample = self._sensors.imu(self._now, v.attitude, v.through_water, v.acceleration, shaken)
        return self._with_fault("sensor/imu", sample)

    def magnetometer(self) -> MagnetometerSample | None:
        sample = self._sensors.magnetometer(self._now, self._vessel.attitude)
        return self._with_fault("sensor/magnetometer", sample)

    def pressure(self) -> PressureSample | None:
        place, sea = self._place(self._mounting.pressure), self._vessel.sea
        rise = 0.0 if sea is None else sea.at(self._vessel.elapsed, place).rise
        sample = self._sensors.pressure(self._now, place[2], rise)
        return self._with_fault("sensor/pressure", sample)

    def dvl(self, device: Dvl) -> DvlSample | None:
        """Without a velocity where the bottom is out of range."""
        place, nu, key = self._place(self._mounting.dvl), self._vessel.velocity, "sensor/dvl"
        altitude = self._vessel.around.floor.depth(place) - place[2]
        match self._faults.get(key):
            case faults.Fault(kind="no_lock"):
                return DvlSample(stamp_ns=self._now, velocity=None, std=device.std)
            case faults.Fault(kind="wrong_lock", value=ahead):
                nu, altitude = (nu[0] - ahead, *nu[1:]), altitude / 2
            case _:
                pass
        return self._with_fault(key, self._sensors.dvl(self._now, nu, altitude, device))

    def usbl(self, device: Usbl) -> UsblSample | None:
        north, east, _ = self._place(self._mounting.usbl)
        return self._with_fault("sensor/usbl", self._sensors.usbl(self._now, north, east, device))

    def _place(self, mount: Placed | Mount) -> Vec3:
        """[m] NED position of a sensor."""
        return place_of(mount.position, self._vessel.position, self._vessel.attitude)

    def battery(self) -> BatterySample | None:
        fault = self._faults.get("sensor/battery")
        share = None if fault is None else faults.CHARGES.get(fault.kind)
        return self._with_fault("sensor/battery", self._battery.sample(self._now, share))

    def leak(self) -> LeakSample | None:
        fault = self._faults.get("sensor/leak")
        wet = fault is not None and fault.kind == "wet"
        return self._with_fault("sensor/leak", LeakSample(stamp_ns=self._now, wet=wet))

    def temperature(self) -> TemperatureSample | None:
        fault = self._faults.get("sensor/temperature")
        inside = WATER_TEMPERATURE + ENCLOSURE_RISE
        if fault is not None and fault.kind == "hot":
            inside = faults.HOT
        silent = "sensor/pressure" in self.silent  # the depth sensor measures the water
        water = None if silent else self._sensors.water
        sample = TemperatureSample(stamp_ns=self._now, temperature=inside, water=water)
        return self._with_fault("sensor/temperature", sample)

    @property
    def battery_empty(self) -> bool:
        return self._battery.empty

    def actuation(self) -> Actuation:
        cause, believed = self._gate.command, self._believed
        return Actuation(
            stamp_ns=self._now,
            thrust=tuple(self._vessel.propulsion.produced)
            if believed is None
            else believed.believed(self._now),
            measured=believed is None,
            actuated_ns=self._gate.obeyed_ns,
            sensor_ns=cause.sensor_ns if cause else None,
            pilot_ns=cause.pilot_ns if cause else None,
            stale=self._gate.ends_ns is None,
            power=self._battery.power,
            outputs=outputs.driven(
                self._vessel.vehicle.output,
                self._status,
                self._gate.gripper(self._now),
                self._now,
            ),
        )

    def truth(self) -> Truth:
        vessel = self._vessel
        u, v, w, p, q, r = vessel.velocity
        position, attitude = vessel.position, vessel.attitude
        roll, pitch, _ = to_euler(attitude)
        return Truth(
            stamp_ns=self._now,
            position=position,
            attitude=attitude,
            velocity=(u, v, w),
            angular_rate=(p, q, r),
            depth_rate=to_world(attitude, (u, v, w))[2],
            roll=roll,
            pitch=pitch,
            heading=self._heading,
            on_floor=vessel.around.floor_felt(position, attitude),
            current=vessel.current,
            tether_pull=vessel.around.tether_pull(position[2], attitude, vessel.through_water),
            faults=self._fault_texts,
        )

    def world(self) -> WorldCheckpoint:
        """State for a restart."""
        return WorldCheckpoint(
            state=self._vessel.state,
            thrust=tuple(self._vessel.propulsion.thrust),
            heading=self._heading,
            used_wh=self._battery.used_wh,
            faults=dict(self._faults),
        )
