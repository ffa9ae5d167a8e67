"""Dives in a current, by a vehicle that is not quite the one its file says: the simulator's truth,
samples, and what the whole estimator makes of them."""

from dataclasses import dataclass, field
from math import cos, pi, sin
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from lindy.api.dives import Stack
from lindy.api.messages import (
    Actuation,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    ThrusterCommand,
    Truth,
    UsblSample,
    VehicleState,
)
from lindy.api.vehicle import Vehicle, wrapped
from messages.events import Outbox
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings
from services.simulator.core import Simulator, at_the_surface
from services.simulator.settings import CurrentSettings, Dvl, Usbl
from services.simulator.settings import Settings as Place

Floats = NDArray[np.float64]
Aid = DvlSample | UsblSample
HZ = 100  # [1/s]
DVL, USBL = Dvl(), Usbl()  # 1 Hz, 1 cm/s; 0.5 Hz, 0.5 m
REST = 5.0  # [s] before it moves
LEG, STRAIGHT = 12.0, 50.0  # [s] of one manoeuvre, short and long
DEPTH = 3.0  # [m] it stays at
FLOW = 0.3  # [m/s] mean speed of the current
STILL = 3.0  # [s] of it to calibrate
MISJUDGED = 0.2  # [-] largest error of damping and added mass in the vehicle file
MISPUSHED = 0.1  # [-] largest error of the thrust that is told
SETTLED, CURRENT_SETTLED = 30.0, 60.0  # [s] in motion, after which errors are judged
POSITION, VELOCITY, CURRENT = slice(0, 2), slice(2, 4), slice(4, 6)


class HorizontalSample(NamedTuple):
    """Everything at one IMU sample."""

    imu: ImuSample
    field: MagnetometerSample
    pressure: PressureSample | None
    aids: list[Aid]  # measured now, told later
    actuation: Actuation
    truth: Truth


class HorizontalWorld(NamedTuple):
    moments: list[HorizontalSample]
    vehicle: Vehicle  # as its file has it


@dataclass
class HorizontalRun:
    """Rows from SETTLED on: north, east, surge, sway, current north, current east; NaN where
    unknown."""

    truth: list[list[float]] = field(default_factory=list[list[float]])
    found: list[list[float]] = field(default_factory=list[list[float]])
    std: list[list[float]] = field(default_factory=list[list[float]])
    held: list[list[float]] = field(default_factory=list[list[float]])  # newest fix, newest DVL
    squares_of: dict[str, list[float]] = field(default_factory=dict[str, list[float]])  # by sensor
    counts: list[str] = field(default_factory=list[str])

    def errors(self, of: slice) -> Floats:
        rows: Floats = np.array(self.found) - np.array(self.truth)
        return rows[_judged_from(of) :, of]

    def naive_errors(self, of: slice) -> Floats:
        """Of the newest fix and the newest DVL sample, as they are."""
        rows: Floats = np.array(self.held) - np.array(self.truth)[:, :4]
        return rows[:, of]

    def squares(self, of: slice) -> Floats:
        """Errors over their spread, squared."""
        return np.square(self.errors(of) / np.array(self.std)[_judged_from(of) :, of])


def place(seed: int, wander: float = 0.0) -> Place:
    """A current from anywhere, that wanders by this much [m/s] in five minutes."""
    rng = np.random.default_rng([seed, 5])
    angle = rng.uniform(-pi, pi)
    flow = CurrentSettings(
        north=FLOW * cos(angle), east=FLOW * sin(angle), std=wander, time_constant=300.0
    )
    return Place(floor_depth=20.0, wake_share=rng.uniform(0.8, 1.0), current=flow)


def world(seed: int, where: Place, seconds: float, interval: float = LEG) -> HorizontalWorld:
    """The vehicle turns to a new heading and pushes anew every `interval` [s]."""
    rng = np.random.default_rng([seed, 77])
    vehicle = Stack().section("vehicle", Vehicle)
    simulator = Simulator(vehicle, where, seed, at_the_surface(vehicle, where), Outbox())
    told = 1.0 + MISPUSHED * rng.uniform(-1.0, 1.0, len(vehicle.thruster))
    moments: list[HorizontalSample] = []
    heading = surge = sway = 0.0
    for k in range(1, round((REST + seconds) * HZ) + 1):
        t, now = k / HZ - REST, k * 1_000_000_000 // HZ
        if t > 0.0:
            if round(t * HZ) % round(interval * HZ) == 1:
                heading, surge, sway = rng.uniform((-pi, 0.0, -6.0), (pi, 20.0, 6.0)).tolist()
            thrust = steered(simulator.truth(), heading, surge, sway)
            command = ThrusterCommand(
                stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=thrust, armed=True
            )
            simulator.obey(command, now)
        simulator.advance(now)
        moments.append(_measured(simulator, k, told))
    return HorizontalWorld(moments, misjudged(vehicle, rng))


def steered(truth: Truth, heading: float, surge: float, sway: float) -> tuple[float, ...]:
    """[N] Of the thrusters port, starboard, lateral and vertical."""
    turn = 6.0 * wrapped(heading - truth.heading) - 3.0 * truth.angular_rate[2]
    turn = max(-1.5, min(1.5, turn)) / 0.172
    dive = 60.0 * (DEPTH - truth.position[2]) - 60.0 * truth.depth_rate
    return surge / 2.0 + turn, surge / 2.0 - turn, sway, max(-30.0, min(30.0, dive))


def misjudged(vehicle: Vehicle, rng: np.random.Generator) -> Vehicle:
    """The vehicle with every damping and added mass wrong by up to MISJUDGED."""
    a, b, c = 1.0 + MISJUDGED * rng.uniform(-1.0, 1.0, (3, 6))
    return msgspec.structs.replace(
        vehicle,
        linear_damping=tuple((a * vehicle.linear_damping).tolist()),
        quadratic_damping=tuple((b * vehicle.quadratic_damping).tolist()),
        added_mass=tuple((c * vehicle.added_mass).tolist()),
    )


def _measured(simulator: Simulator, k: int, told: Floats) -> HorizontalSample:
    imu, field_sample = simulator.imu(), simulator.magnetometer()
    assert imu is not None
    assert field_sample is not None
    aids: list[Aid | None] = []
    if k % round(HZ / DVL.rate) == 0:
        aids.append(simulator.dvl(DVL))
    if k % round(HZ / USBL.rate) == 37:
        aids.append(simulator.usbl(USBL))
    actuation = simulator.actuation()
    thrust = tuple((told * actuation.thrust).tolist())
    return HorizontalSample(
        imu, field_sample, simulator.pressure() if k % 2 else None,
        [aid for aid in aids if aid is not None],
        msgspec.structs.replace(actuation, thrust=thrust), simulator.truth(),
    )  # fmt: skip


def observe(
    seen: HorizontalWorld,
    dvl_latency: float = DVL.latency,
    usbl_latency: float = USBL.latency,
    thrust_heard: bool = True,
) -> HorizontalRun:
    """What the estimator makes of a world; latencies in s."""
    settings = Settings(calibration=CalibrationSettings(still_time=STILL))
    estimator = Estimator(settings, seen.vehicle.floating_depth, None, seen.vehicle)
    found, late = HorizontalRun(), list[tuple[int, Aid]]()
    fix = held = (np.nan, np.nan)
    for k, moment in enumerate(seen.moments, start=1):
        now = moment.imu.stamp_ns
        for aid in moment.aids:
            latency = dvl_latency if isinstance(aid, DvlSample) else usbl_latency
            late.append((now + round(latency * 1e9), aid))
        for aid in [aid for due, aid in late if due <= now]:
            tell(estimator, aid)
            if not isinstance(aid, DvlSample):
                fix = aid.north, aid.east
            elif aid.velocity is not None:
                held = aid.velocity[:2]
        late = [pair for pair in late if pair[0] > now]
        state = step(estimator, moment, thrust_heard)
        _collect(found, estimator, now)
        if k / HZ - REST >= SETTLED and state is not None:
            _note(found, moment.truth, state)
            found.held.append([*fix, *held])
    found.counts = list(estimator.outbox.counts.elements())
    return found


def tell(estimator: Estimator, aid: Aid) -> None:
    if isinstance(aid, DvlSample):
        estimator.dvl(aid)
    else:
        estimator.usbl(aid)


def step(estimator: Estimator, moment: HorizontalSample, thrust_heard: bool) -> VehicleState | None:
    if moment.pressure is not None:
        estimator.pressure(moment.pressure)
    estimator.magnetometer(moment.field)
    if thrust_heard:
        estimator.actuation(moment.actuation)
    return estimator.imu(moment.imu, moment.imu.stamp_ns)


def _collect(found: HorizontalRun, estimator: Estimator, now: int) -> None:
    """Normalised innovation squared of each sample."""
    for name, source in estimator.aid_sources(now):
        sensor = name.partition("_")[0]
        if sensor in ("dvl", "usbl") and source.innovation is not None and source.variance:
            square = source.innovation**2 + (source.spread or 0.0) ** 2
            found.squares_of.setdefault(sensor, []).append(square / source.variance)


def _note(found: HorizontalRun, truth: Truth, state: VehicleState) -> None:
    found.truth.append([*truth.position[:2], *truth.velocity[:2], *truth.current[:2]])
    parts = (
        state.north, state.east, state.surge_velocity, state.sway_velocity,
        state.current_north, state.current_east,
    )  # fmt: skip
    found.found.append([np.nan if part is None else part.value for part in parts])
    found.std.append([np.nan if part is None else part.std for part in parts])


def _judged_from(of: slice) -> int:
    return round((CURRENT_SETTLED - SETTLED) * HZ) if of == CURRENT else 0


def rms(rows: Floats) -> float:
    """Of one component."""
    return float(np.sqrt(np.mean(np.square(rows))))
