"""What the observers know, as one `VehicleState`.

What is valid when:

- calibrating: nothing. Depth is given as the depth at which the vehicle floats, because it should
  be floating, but that is not a measurement.
- running: attitude, headings and yaw rate as long as the IMU is heard; depth and depth rate for
  two seconds after an accepted pressure sample.
- IMU silent: nothing new is said at first, and whoever listens sees the state grow old. From
  `imu_patience` on, states come at the topic's rate with everything the IMU gives marked invalid.
  Depth and depth rate go on from pressure alone, with the spread of a filter that has no
  accelerometer. `sensor_ns` stays at the last IMU sample.
"""

from messages.message import Estimate
from messages.state import VehicleState
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.depth.depth_observer import DepthObserver
from services.estimation.horizontal.horizontal_observer import HorizontalObserver

UNKNOWN = (None, None)


def calibrating(
    now: int, sensor_ns: int, attitude: AttitudeObserver, floating_depth: float, seconds_left: float
) -> VehicleState:
    """Floating depth [m] of the origin; [s] of rest still to come."""
    roll, pitch = attitude.tilt(valid=False)
    return VehicleState(
        stamp_ns=now,
        sensor_ns=sensor_ns,
        phase="calibrating",
        calibration_left=seconds_left,
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
    """Of a calibrated vehicle."""
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
