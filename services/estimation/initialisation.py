"""Initial observers of attitude and depth: with nothing known, after a calibration, or from a
checkpoint in mid-dive."""

from math import degrees, hypot, pi, sqrt
from typing import NamedTuple

from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.checkpoint import EstimationCheckpoint
from services.estimation.checks import range_checks
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.estimation.events import Events
from services.estimation.settings import Settings
from services.estimation.startup.calibration import Calibrated
from services.estimation.startup.resting_bias import RestingBias
from services.marine.vehicle import ATMOSPHERE, GRAVITY
from services.marine.water import density_of

STANDARD = Atmosphere(ATMOSPHERE, 2000.0)  # [Pa] 1σ of the weather
MORE_THAN_NOISE = 1.2  # [-] a spread that the noise of a hundred samples does not have by chance
NO_BIAS = (0.0, 0.0, 0.0)  # [rad/s]


class Observers(NamedTuple):
    attitude: AttitudeObserver
    resting: RestingBias
    depth: DepthObserver


def unknown(settings: Settings) -> Observers:
    """Before any measurement."""
    return Observers(
        AttitudeObserver(settings.attitude, NO_BIAS, 0.0, pi),
        RestingBias(settings.calibration, NO_BIAS),
        _depth(settings, STANDARD, 0.0),
    )


def calibrated(
    settings: Settings, learnt: Calibrated, floating_depth: float, at_ns: int, events: Events
) -> Observers:
    """After calibration at this time [ns], with the origin at `floating_depth` [m]."""
    atmosphere = _atmosphere(settings, learnt, floating_depth, events)
    heading = 0.0 if learnt.heading is None else learnt.heading
    attitude = AttitudeObserver(settings.attitude, learnt.gyro_bias, heading, 0.0)
    attitude.start(learnt.specific_force)
    if learnt.field is not None and not attitude.agree(at_ns, learnt.field):
        events.note("disturbed:sensor/magnetometer")
        events.warn("the magnetic field here is not the Earth's: the compass is not used")
    depth = _depth(settings, atmosphere, learnt.accelerometer_bias)
    depth.start(learnt.pressure, learnt.pressures, at_ns, attitude.lean(learnt.specific_force))
    bias = ", ".join(f"{degrees(rate):+.3f}" for rate in learnt.gyro_bias)
    air = f"{atmosphere.pressure / 100.0:.1f} hPa"
    events.say(f"calibrated: gyroscope bias {bias} deg/s, atmosphere {air}")
    return Observers(attitude, RestingBias(settings.calibration, learnt.gyro_bias), depth)


def resumed(settings: Settings, kept: EstimationCheckpoint, events: Events) -> Observers:
    """Resume a dive from a checkpoint: no calibration under water."""
    attitude = AttitudeObserver(
        settings.attitude, kept.gyro_bias, kept.heading, min(pi, kept.heading_std)
    )
    strength, dip = kept.field_strength, kept.field_dip
    if kept.north is not None and strength is not None and dip is not None:
        attitude.compass.resume(kept.north, strength, dip)
    atmosphere = Atmosphere(kept.atmosphere, kept.atmosphere_std)
    events.warn(
        f"goes on with the dive: atmosphere {kept.atmosphere / 100.0:.1f} hPa, "
        f"heading {round(degrees(kept.heading)) % 360} deg from before the restart"
    )
    return Observers(
        attitude,
        RestingBias(settings.calibration, kept.gyro_bias),
        _depth(settings, atmosphere, kept.accelerometer_bias),
    )


def _depth(settings: Settings, atmosphere: Atmosphere, bias: float) -> DepthObserver:
    return DepthObserver(settings.depth, atmosphere, density_of(settings.water_density), bias)


def _surface_std(noise: float, learnt: Calibrated) -> float:
    """[Pa] 1σ of the atmosphere above a vehicle that floats, with this noise [Pa] of one sample.
    One that bobs or rises is not where it floats at rest."""
    std = noise / sqrt(learnt.pressures)
    motion = sqrt(max(0.0, learnt.pressure_spread**2 - (MORE_THAN_NOISE * noise) ** 2))
    return hypot(std, motion, learnt.pressure_change)


def _atmosphere(
    settings: Settings, learnt: Calibrated, floating_depth: float, events: Events
) -> Atmosphere:
    """The air above the floating vehicle."""
    water = density_of(settings.water_density) * GRAVITY * floating_depth
    if range_checks.atmosphere(learnt.pressure - water):
        if not learnt.driven:
            std = _surface_std(settings.depth.pressure_std, learnt)
            return Atmosphere(learnt.pressure - water, std)
        events.note("assumed:atmosphere")
        events.warn(
            "the thrusters ran during calibration, so the vehicle may not have floated: "
            "the standard atmosphere is used, depth may be wrong by 0.3 m"
        )
        return STANDARD
    events.note("implausible:atmosphere")
    events.warn(
        f"{learnt.pressure / 100.0:.0f} hPa is not the air above a floating vehicle: "
        f"the standard atmosphere is used, depth may be wrong by 0.3 m"
    )
    return STANDARD
