"""The table [estimation.horizontal] of a vehicle file."""

from typing import Annotated

import msgspec

from messages.units import Positive, Share


class HorizontalSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise, time constants and limits of the horizontal motion's measurements."""

    # The accelerometer.
    acceleration_noise: Positive = 0.01  # [m/s²/√Hz] white noise, with vibration
    # A lasting acceleration tilts the attitude estimate and so hides itself: only changes are seen.
    lean_std: Positive = 0.2  # [m/s²] gravity component due to the tilt error
    lean_time: Positive = 10.0  # [s] its correlation time
    motion_noise: Positive = 0.3  # [m/s²/√Hz] unknown motion while the IMU is silent

    # The vehicle's own model: thrust against drag.
    model_noise: Positive = 0.1  # [m/s²/√Hz] forces not modelled: tether, waves, other wakes
    damping_share: Share = 0.2  # [-] 1σ of the damping, relative to the vehicle file
    wake_share: Share = 1.0  # [-] of the Munk moment cancelled by the wake
    actuation_patience: Positive = 0.5  # [s] an older thrust report is not used

    # The water.
    current_std: Positive = 0.5  # [m/s] of each component, before any measurement
    current_time: Positive = 1800.0  # [s] correlation time, by tide and change of place
    current_limit: Positive = 0.15  # [m/s] a current with a larger std is not published

    # Heading error, outlier gate and validity.
    heading_time: Positive = 100.0  # [s] correlation time of deviation A
    iron_std: Positive = 0.0685  # [rad] of the deviation's B and C each: own iron, error of tilt
    iron_time: Positive = 7200.0  # [s] correlation time of those: a dive
    gate: Annotated[float, msgspec.Meta(ge=3.0, le=100.0)] = 6.0  # [σ] innovations beyond: outlier
    outliers: Annotated[int, msgspec.Meta(ge=2, le=100)] = 5  # in a row: the filter restarts
    dvl_valid_for: Positive = 3.0  # [s] after the last accepted sample
    usbl_valid_for: Positive = 15.0  # [s]
    lost_after: Positive = 60.0  # [s] without either: prediction is useless
    oldest: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 4.0  # [s] largest age of a sample
