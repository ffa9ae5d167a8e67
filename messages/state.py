"""Estimated state of the drone. From `estimation`; received by `reference` and `control`."""

from typing import Literal

from msgspec import UNSET, UnsetType

from messages.message import Estimate, Message
from messages.units import Count, Finite, Name, Names, NotNegative, Quaternion, Share, Stamp


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


# The drone's present state, predicted from delayed telemetry. From `predictor`, topside.


class Prediction(Message, frozen=True, kw_only=True):
    """The newest state that arrived, propagated to the present with the commands still on the
    link."""

    state_ns: Stamp  # [ns] sensor sample of the state it starts from
    ahead_ms: NotNegative  # [ms] from that sample to now
    depth: Finite  # [m] positive down
    heading: Finite  # [rad] accumulates past ±π
    depth_rate: Finite  # [m/s]
    yaw_rate: Finite  # [rad/s]
    forward: Finite  # [m] moved ahead since that state
    starboard: Finite  # [m] moved sideways since that state
    north: Finite | None = None  # [m] NED, where the drone measures its position
    east: Finite | None = None  # [m]


# What the estimator makes of its measurements, one message per measured quantity. From
# `estimation`, for people and files.
#
# Of one sample: the innovation is what was measured minus what was predicted; its variance is what
# the observer expects of it; the test ratio is its square over that of the largest one allowed, so
# that a sample beyond 1 is rejected (PX4's EstimatorAidSource has the same).


class AidSource(Message, frozen=True, kw_only=True):
    """All samples since the message before: one, or those of a tenth of a second. `stamp_ns` is the
    time of the newest."""

    unit: Name  # of value and innovation; its square, of the variance
    samples: Count
    value: Finite | None = None  # [unit] newest; None: no sample was compared
    innovation: Finite | None = None  # [unit] mean
    spread: NotNegative | None = None  # [unit] standard deviation of the innovations
    variance: NotNegative | None = None  # [unit²] of one innovation, as expected; mean
    test_ratio: NotNegative | None = None  # [-] largest; beyond 1 rejected
    whole_until: NotNegative = 1.0  # [-] test ratio from which a sample has less weight
    weight: Share = 0.0  # [-] mean over the compared samples; 0 rejected, 1 whole
    rejected: Share = 0.0  # [-] of all samples
    reasons: Names = ()  # events that say why samples were rejected
    # [-] Running means, over a second or 20 samples, of the innovation over its standard deviation
    # and of that squared: 0 and 1 if the spread is as stated.
    mean: Finite = 0.0
    variance_ratio: NotNegative = 1.0
    verdict: Name | None = None  # event that says why the sensor is not trusted now; None: it is
