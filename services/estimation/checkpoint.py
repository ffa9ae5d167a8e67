"""What a restart in mid-dive cannot learn again, because the vehicle no longer floats at rest."""

import msgspec

from messages.units import Finite, NotNegative, Stamp
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.depth.depth_observer import DepthObserver


class EstimationCheckpoint(msgspec.Struct, frozen=True, kw_only=True):
    """Of the newest moment that was written down."""

    stamp_ns: Stamp  # [ns] when this was true
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
    """What a running estimator knows now [ns]."""
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
