"""The observers' estimates as one `VehicleState`.

Validity:

- calibrating: nothing. Depth is the floating depth, which is not a measurement. While something is
  wrong with a sensor, `blocked_by` is the name of its count.
- running: attitude, headings and yaw rate while IMU samples arrive; depth and depth rate for two
  seconds after an accepted pressure sample. The depth rate also for as long after it as the
  accelerometer alone keeps it known.
- gyroscope's bias changed: attitude is learnt anew from gravity; headings and yaw rate are not
  valid until the magnetometer has measured them, or the bias is as before (gyro_check.py).
- IMU back after half a second or more: headings are not valid until the magnetometer has measured
  how far the vehicle turned meanwhile (unseen_turn.py). Without one, north is never known, and the
  control heading goes on from where it was, with its standard deviation.
- vertical acceleration and pressure disagree: depth and rate from pressure alone, the acceleration
  is not valid.
- IMU silent: at first no states, so receivers see the last one age. After `imu_patience`, states
  come at the topic's rate with everything from the IMU invalid. Depth and depth rate continue from
  pressure alone, with the standard deviation of a filter without accelerometer. `sensor_ns` stays
  at the last IMU sample.
"""

from msgspec import UNSET

from messages.message import Estimate
from messages.state import VehicleState
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.depth.depth_observer import DepthObserver
from services.estimation.horizontal.horizontal_observer import HorizontalObserver

UNKNOWN = (None, None)


def calibrating(
    now: int,
    sensor_ns: int,
    attitude: AttitudeObserver,
    floating_depth: float,
    seconds_left: float,
    blocked_by: str | None,
) -> VehicleState:
    """State during calibration; `floating_depth` [m] of the origin, `seconds_left` [s] of rest."""
    roll, pitch = attitude.tilt(valid=False)
    return VehicleState(
        stamp_ns=now,
        sensor_ns=sensor_ns,
        phase="calibrating",
        calibration_left=seconds_left if blocked_by is None else None,
        blocked_by=blocked_by or UNSET,
        depth=Estimate(floating_depth, 0.5, valid=False),
        depth_rate=Estimate(0.0, 0.5, valid=False),
        depth_acceleration=Estimate(0.0, 1.0, valid=False),
        attitude=attitude.attitude,
        roll=roll,
        pitch=pitch,
        heading=attitude.heading(valid=False),
        heading_navigation=attitude.heading_navigation(valid=False, now=now),
        yaw_rate=attitude.yaw_rate(valid=False),
        surge_velocity=None,
        sway_velocity=None,
        north=None,
        east=None,
        current_north=None,
        current_east=None,
        pressure_age_ms=None,
    )


def running(
    now: int,
    sensor_ns: int,
    hears_imu: bool,
    attitude: AttitudeObserver,
    depth: DepthObserver,
    horizontal: HorizontalObserver,
) -> VehicleState:
    """State of a calibrated vehicle."""
    down, rate, acceleration = depth.estimates(now)
    roll, pitch = attitude.tilt(hears_imu)
    north, east = horizontal.position(now) or UNKNOWN
    surge, sway = horizontal.velocity(now) or UNKNOWN
    compass = attitude.heading_navigation(hears_imu, now)
    current_north, current_east = horizontal.current(now) or UNKNOWN
    return VehicleState(
        stamp_ns=now,
        sensor_ns=sensor_ns,
        phase="running",
        calibration_left=None,
        depth_moved=depth.moved or UNSET,
        depth=down,
        depth_rate=rate,
        depth_acceleration=acceleration,
        attitude=attitude.attitude,
        roll=roll,
        pitch=pitch,
        heading=attitude.heading(hears_imu),
        heading_navigation=None if compass is None else horizontal.heading(compass),
        yaw_rate=attitude.yaw_rate(hears_imu),
        surge_velocity=surge,
        sway_velocity=sway,
        north=north,
        east=east,
        current_north=current_north,
        current_east=current_east,
        pressure_age_ms=depth.pressure_age_ms(now),
    )
