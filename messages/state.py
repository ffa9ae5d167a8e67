"""Estimated state of the drone. From `estimation`; received by `reference` and `control`."""

from typing import Literal

from msgspec import UNSET, UnsetType

from messages.message import Estimate, Message
from messages.units import Count, Finite, Name, Names, NotNegative, Quaternion, Stamp


class VehicleState(Message, frozen=True, kw_only=True):
    """Each estimate has a value, a standard deviation and a validity. Unknown is None, never 0."""

    sensor_ns: Stamp  # [ns] the IMU sample this state belongs to
    phase: Literal["calibrating", "running"]
    calibration_left: NotNegative | None = None  # [s] at rest still to go; None: done, or not known
    blocked_by: Name | UnsetType = UNSET  # count that keeps it from ending; absent: none
    troubles: Names | UnsetType = (
        UNSET  # counts that say which sensors cannot be used; absent: none
    )
    depth_moved: Finite | UnsetType = UNSET  # [m] sum of pressure jumps followed; absent: none
    depth_corrected: Finite | UnsetType = UNSET  # [m] sum, of where it came to rest; absent: none
    depth: Estimate  # [m] positive down, of the vehicle's origin below the surface
    depth_rate: Estimate  # [m/s] positive down
    depth_acceleration: Estimate  # [m/s²] positive down
    attitude: Quaternion  # [-] q_NB as w, x, y, z; yaw is the control heading
    roll: Estimate  # [rad] + right wing down
    pitch: Estimate  # [rad] + nose up
    heading: Estimate  # [rad] control heading: no magnetometer, accumulates past ±π
    heading_navigation: Estimate | None  # [rad] with magnetometer, clockwise from north, ±π
    yaw_rate: Estimate  # [rad/s] about the body's down axis
    surge_velocity: Estimate | None = None  # [m/s] over the ground, along the body's forward axis
    sway_velocity: Estimate | None = None  # [m/s] along its starboard axis; both tilt with the body
    north: Estimate | None = None  # [m] NED
    east: Estimate | None = None  # [m] NED
    current_north: Estimate | None = None  # [m/s] of the water over the ground, NED
    current_east: Estimate | None = None  # [m/s]
    pressure_age_ms: NotNegative | None = None  # [ms] since the last accepted pressure sample
    # Names the origin of north and east: 0 that of the acoustic positions, else one that was set
    # where the drone then was. Another number: another origin. Absent: no position.
    origin: Count | UnsetType = UNSET
