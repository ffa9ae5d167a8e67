"""The table [estimation] of a vehicle file."""

from typing import Annotated

import msgspec

from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.checks.sensor_watch import WatchSettings
from services.estimation.depth.depth_filter import DepthSettings
from services.estimation.horizontal.horizontal_settings import HorizontalSettings
from services.estimation.startup.calibration import CalibrationSettings
from services.marine.vehicle import SEA_WATER
from services.marine.water import Density


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [estimation] of a vehicle file."""

    water_density: Density = SEA_WATER  # [kg/m³], "fresh", "sea" or { temperature, salinity }
    imu_patience: Annotated[float, msgspec.Meta(ge=0.05, le=5.0)] = 0.2  # [s] of a silent IMU
    depth: DepthSettings = DepthSettings()
    attitude: AttitudeSettings = AttitudeSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    horizontal: HorizontalSettings = HorizontalSettings()
    watch: WatchSettings = WatchSettings()
