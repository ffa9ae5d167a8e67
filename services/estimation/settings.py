"""The table [estimation] of a vehicle file."""

from typing import Annotated

import msgspec

from messages import topics
from messages.units import Positive, Share, WithinAnHour
from services.marine.vehicle import SEA_WATER
from services.marine.water import Density

UpToTen = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]
UpTo600 = Annotated[float, msgspec.Meta(gt=0.0, le=600.0)]
Latency = Annotated[float, msgspec.Meta(ge=0.0, le=0.3)]
SensorRate = Annotated[float, msgspec.Meta(ge=1.0, le=100.0)]
ImuRate = Annotated[float, msgspec.Meta(ge=10.0, le=400.0)]


class DepthSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise of what depth is measured with, as stated; the filter measures it, too."""

    pressure_std: Positive = 500.0  # [Pa] of one pressure sample; 5 mbar
    pressure_latency: Latency = 0.0  # [s] from a sample's time of validity to its stamp
    acceleration_noise: Positive = 0.0016  # [m/s²/√Hz] of the accelerometer
    # [m/s²] of its bias, forward and starboard: 5 mg, unseen at rest
    horizontal_bias_std: Positive = 0.05


class AttitudeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Attitude and headings."""

    gravity_tolerance: UpToTen = 0.5  # [m/s²] | |f| - g | at rest; beyond it the IMU is wrong
    # [rad] that iron turns the compass: 0.2 µT left, in a level field of 14 µT. More iron:
    # calibrate, or state more. What a wrong tilt adds the filter knows.
    compass_std: UpToTen = 0.014


class CalibrationSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The rest before the dive."""

    still_time: UpTo600 = 10.0  # [s] at rest without a break; 0.17 deg/min of drift, see start.py
    largest_bias: UpTo600 = 0.1  # [rad/s] a mean rate beyond this is a turn, not a bias
    # [Pa] of the air, as measured by something else; None: above the floating vehicle, at rest
    atmosphere: Annotated[float, msgspec.Meta(ge=50e3, le=120e3)] | None = None


class HorizontalSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the hull's model needs beside the vehicle."""

    wake_share: Share = 1.0  # [-] of the Munk moment cancelled by the wake


class WatchSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How long the IMU may repeat itself, and the rates. Another rate is told, and its samples are
    used."""

    imu_frozen: WithinAnHour = 0.2  # [s]
    # The same as long as the thrust does not change, for an IMU whose steps are coarser than its
    # noise; None: no longer than `imu_frozen`.
    imu_frozen_at_rest: WithinAnHour | None = None  # [s]
    imu_rate: ImuRate = topics.IMU.hz  # [1/s]
    pressure_rate: SensorRate = topics.PRESSURE.hz  # [1/s] of this vehicle's sensor
    magnetometer_rate: SensorRate = topics.MAGNETOMETER.hz  # [1/s] the same


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    water_density: Density = SEA_WATER  # [kg/m³], "fresh", "sea" or { temperature, salinity }
    depth: DepthSettings = DepthSettings()
    attitude: AttitudeSettings = AttitudeSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    horizontal: HorizontalSettings = HorizontalSettings()
    watch: WatchSettings = WatchSettings()
