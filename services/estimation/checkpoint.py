"""State for a restart in mid-dive: what can only be measured while the vehicle floats at rest."""

import msgspec

from messages.units import Finite, NotNegative, Stamp
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.depth.depth_observer import DepthObserver


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
