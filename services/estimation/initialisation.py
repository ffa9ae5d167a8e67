"""Initial observers of attitude and depth: with nothing known, after a calibration, or from a
checkpoint in mid-dive, and that checkpoint: what can only be measured while the vehicle floats at
rest."""

from math import degrees, hypot, pi, sqrt
from typing import NamedTuple

import msgspec

from messages import events, topics
from messages.events import Outbox
from messages.units import Finite, NotNegative, Stamp, Vec3
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.attitude.gyroscope import RestingBias
from services.estimation.depth.depth_observer import LATEST_AGE, Atmosphere, DepthObserver
from services.estimation.sensor_watch import LEAST_PRESSURE, MOST_PRESSURE
from services.estimation.settings import Settings
from services.estimation.startup import first_samples
from services.estimation.startup.calibration import Calibrated
from services.estimation.startup.calibration_phase import StartLimits
from services.marine.vehicle import ATMOSPHERE, GRAVITY
from services.marine.water import density_of

STANDARD = Atmosphere(ATMOSPHERE, 2000.0)  # [Pa] 1σ of the weather
GIVEN_STD = 100.0  # [Pa] 1σ of an atmosphere that another instrument measured
MORE_THAN_NOISE = 1.2  # [-] a spread that the noise of a hundred samples does not have by chance
# [Pa] Outside, the vehicle did not float: from a mountain lake at 3000 m to the highest pressure of
# the air measured below 750 m, 1083.8 hPa (Agata, 1968; WMO archive of extremes). A calibration
# less than 0.7 m under water, in standard air, cannot be told from high pressure.
LEAST_ATMOSPHERE, MOST_ATMOSPHERE = 70e3, 108.4e3
NO_BIAS = (0.0, 0.0, 0.0)  # [rad/s]
IMU_PATIENCE_NS = 200_000_000  # [ns] of a silent IMU, before a state is predicted without it


class EstimationCheckpoint(msgspec.Struct, frozen=True, kw_only=True):
    """The estimator's state at `stamp_ns`."""

    stamp_ns: Stamp  # [ns] time of validity
    atmosphere: NotNegative  # [Pa]
    atmosphere_std: NotNegative  # [Pa]
    gyro_bias: tuple[Finite, Finite, Finite]  # [rad/s] FRD
    accelerometer_bias: Finite  # [m/s²] along down
    heading: Finite  # [rad] control heading, accumulated
    heading_std: NotNegative  # [rad] drift since calibration
    north: Finite | None = None  # [rad] navigation minus control heading
    field_strength: NotNegative | None = None  # [µT] normal
    field_dip: Finite | None = None  # [rad] normal


def worth_keeping(
    attitude: AttitudeObserver, depth: DepthObserver, now: int
) -> EstimationCheckpoint:
    """The checkpoint of a running estimator at `now` [ns]."""
    control, compass = attitude.control, attitude.compass
    return EstimationCheckpoint(
        stamp_ns=now,
        atmosphere=depth.atmosphere.pressure,
        atmosphere_std=depth.atmosphere.std,
        gyro_bias=attitude.gyro_bias,
        accelerometer_bias=depth.bias,
        heading=control.heading,
        heading_std=control.std,
        north=compass.offset,
        field_strength=compass.field.strength,
        field_dip=compass.field.dip,
    )


def start_limits(settings: Settings) -> StartLimits:
    """What the sensors may say before the dive: as much as the observers can use in it."""
    least, most = LEAST_PRESSURE, MOST_PRESSURE
    late = LATEST_AGE - settings.depth.pressure_latency
    sensors = (
        first_samples.of_imu(IMU_PATIENCE_NS * 1e-9),
        first_samples.of_pressure(least, most, late),
        first_samples.of_magnetometer(LATEST_AGE),
    )
    return StartLimits(settings.attitude.gravity_tolerance, sensors)


class Observers(NamedTuple):
    attitude: AttitudeObserver
    resting: RestingBias
    depth: DepthObserver


def unknown(settings: Settings) -> Observers:
    """Before any measurement."""
    return Observers(
        AttitudeObserver(settings.attitude, NO_BIAS, 0.0, pi),
        resting(settings, NO_BIAS),
        _depth(settings, STANDARD, 0.0),
    )


def calibrated(
    settings: Settings, learnt: Calibrated, floating_depth: float, at_ns: int, outbox: Outbox
) -> Observers:
    """After calibration at this time [ns], with the origin at `floating_depth` [m]."""
    atmosphere = atmosphere_of(settings, learnt, floating_depth, outbox)
    heading = 0.0 if learnt.heading is None else learnt.heading
    attitude = AttitudeObserver(settings.attitude, learnt.gyro_bias, heading, 0.0)
    attitude.start(learnt.specific_force)
    if learnt.field is not None and not attitude.agree(at_ns, learnt.field):
        outbox.tell(events.DISTURBED(topics.MAGNETOMETER.key))
        outbox.say("warning", "the magnetic field here is not the Earth's: the compass is not used")
    depth = _depth(settings, atmosphere, learnt.accelerometer_bias)
    depth.start(learnt.pressure, learnt.pressures, at_ns, attitude.axes(learnt.specific_force))
    bias = ", ".join(f"{degrees(rate):+.3f}" for rate in learnt.gyro_bias)
    air = f"{atmosphere.pressure / 100.0:.1f} hPa"
    outbox.say("info", f"calibrated: gyroscope bias {bias} deg/s, atmosphere {air}")
    return Observers(attitude, resting(settings, learnt.gyro_bias), depth)


def roughly(
    settings: Settings, attitude: AttitudeObserver, outbox: Outbox
) -> tuple[RestingBias, DepthObserver]:
    """In motion, without any rest: the attitude as it is, depth from the next sample on."""
    outbox.tell(events.ROUGH_CALIBRATION())
    atmosphere = _given(settings) or STANDARD
    return resting(settings, attitude.gyro_bias), _depth(settings, atmosphere, 0.0)


def resumed(settings: Settings, kept: EstimationCheckpoint, outbox: Outbox) -> Observers:
    """Resume a dive from a checkpoint: no calibration under water."""
    attitude = AttitudeObserver(
        settings.attitude, kept.gyro_bias, kept.heading, min(pi, kept.heading_std)
    )
    strength, dip = kept.field_strength, kept.field_dip
    if kept.north is not None and strength is not None and dip is not None:
        attitude.compass.resume(kept.north, strength, dip)
    atmosphere = Atmosphere(kept.atmosphere, kept.atmosphere_std)
    outbox.say(
        "warning",
        f"goes on with the dive: atmosphere {kept.atmosphere / 100.0:.1f} hPa, "
        f"heading {round(degrees(kept.heading)) % 360} deg from before the restart",
    )
    return Observers(
        attitude,
        resting(settings, kept.gyro_bias),
        _depth(settings, atmosphere, kept.accelerometer_bias),
    )


def resting(settings: Settings, bias: Vec3) -> RestingBias:
    """For a gyroscope that was calibrated with this bias [rad/s]."""
    return RestingBias(bias, settings.calibration.still_time, settings.calibration.largest_bias)


def _depth(settings: Settings, atmosphere: Atmosphere, bias: float) -> DepthObserver:
    return DepthObserver(settings.depth, atmosphere, density_of(settings.water_density), bias)


def _given(settings: Settings) -> Atmosphere | None:
    air = settings.calibration.atmosphere
    return None if air is None else Atmosphere(air, GIVEN_STD)


def _surface_std(noise: float, learnt: Calibrated) -> float:
    """[Pa] 1σ of the atmosphere above a vehicle that floats, with this noise [Pa] of one sample.
    One that bobs or rises is not where it floats at rest."""
    std = noise / sqrt(learnt.pressures)
    motion = sqrt(max(0.0, learnt.pressure_spread**2 - (MORE_THAN_NOISE * noise) ** 2))
    return hypot(std, motion, learnt.pressure_change)


def atmosphere_of(
    settings: Settings, learnt: Calibrated, floating_depth: float, outbox: Outbox
) -> Atmosphere:
    """The air above the floating vehicle."""
    if (given := _given(settings)) is not None:
        return given
    air = learnt.pressure - density_of(settings.water_density) * GRAVITY * floating_depth
    if not LEAST_ATMOSPHERE <= air <= MOST_ATMOSPHERE:
        outbox.tell(events.IMPLAUSIBLE_ATMOSPHERE(detail=f"{learnt.pressure / 100.0:.0f} hPa"))
        return STANDARD
    if learnt.driven:
        outbox.tell(events.ASSUMED_ATMOSPHERE())
        return STANDARD
    return Atmosphere(air, _surface_std(settings.depth.pressure_std, learnt))
