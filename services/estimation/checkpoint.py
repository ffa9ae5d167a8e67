"""What can only be measured while the vehicle floats at rest, kept for a restart in mid-dive."""

import msgspec

from messages.units import Finite, NotNegative, Stamp


class EstimationCheckpoint(msgspec.Struct, frozen=True, kw_only=True):
    """The estimator's state at `stamp_ns`."""

    stamp_ns: Stamp  # [ns] time of validity
    atmosphere: NotNegative  # [Pa]
    atmosphere_std: NotNegative  # [Pa]
    gyro_bias: tuple[Finite, Finite, Finite]  # [rad/s] FRD
    accelerometer_bias: tuple[Finite, Finite, Finite]  # [m/s²] FRD
    heading: Finite  # [rad] control heading, accumulated
    heading_std: NotNegative  # [rad] drift since calibration
    north: Finite | None = None  # [rad] navigation minus control heading
    deviation: Finite = 0.0  # [rad] of the compass
    field_strength: NotNegative | None = None  # [µT] normal
    field_dip: Finite | None = None  # [rad] normal
