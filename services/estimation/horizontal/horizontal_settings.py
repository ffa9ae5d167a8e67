"""What the table [estimation.horizontal] of a vehicle file may say."""

from typing import Annotated

import msgspec

from messages.units import Positive, Share


class HorizontalSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far each measurement of the horizontal motion is trusted, and for how long."""

    # The accelerometer.
    acceleration_noise: Positive = 0.01  # [m/s²/√Hz] white noise, with vibration
    # The attitude leans into an acceleration that lasts, and hides it: only changes are seen.
    lean_std: Positive = 0.2  # [m/s²] what the error of tilt lets gravity add
    lean_time: Positive = 10.0  # [s] for which that stays about the same
    motion_noise: Positive = 0.3  # [m/s²/√Hz] unknown motion while the IMU is silent

    # The vehicle's own model: thrust against drag.
    model_noise: Positive = 0.1  # [m/s²/√Hz] forces it does not know: tether, waves, other wakes
    damping_share: Share = 0.2  # [-] 1σ of the damping, over what the vehicle file says
    wake_share: Share = 1.0  # [-] of the Munk moment that the wake takes back
    actuation_patience: Positive = 0.5  # [s] a thrust older than this is not known

    # The water.
    current_std: Positive = 0.5  # [m/s] of each component, before anybody has measured it
    current_time: Positive = 1800.0  # [s] in which the tide and the place change it
    current_limit: Positive = 0.15  # [m/s] a current known less well than this is not told

    # When to believe and for how long.
    heading_time: Positive = 100.0  # [s] for which the rest of the heading's error stays the same
    iron_std: Positive = 0.0685  # [rad] of the deviation's B and C each: own iron, error of tilt
    iron_time: Positive = 7200.0  # [s] for which those stay about the same: a dive
    gate: Annotated[float, msgspec.Meta(ge=3.0, le=100.0)] = 6.0  # [σ] innovations beyond: outlier
    outliers: Annotated[int, msgspec.Meta(ge=2, le=100)] = 5  # in a row: the world has changed
    dvl_valid_for: Positive = 3.0  # [s] after the last accepted sample
    usbl_valid_for: Positive = 15.0  # [s]
    lost_after: Positive = 60.0  # [s] without either: prediction is worthless
    oldest: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 4.0  # [s] age of a usable sample
