"""The table [estimation] of a vehicle file."""

import msgspec

from messages.units import Share
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.depth.depth_filter import DepthSettings
from services.estimation.sensor_watch import WatchSettings
from services.estimation.startup.calibration import CalibrationSettings
from services.marine.vehicle import SEA_WATER
from services.marine.water import Density


class HorizontalSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the hull's model of the horizontal motion needs beside the vehicle."""

    wake_share: Share = 1.0  # [-] of the Munk moment cancelled by the wake


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [estimation] of a vehicle file."""

    water_density: Density = SEA_WATER  # [kg/m³], "fresh", "sea" or { temperature, salinity }
    depth: DepthSettings = DepthSettings()
    attitude: AttitudeSettings = AttitudeSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    horizontal: HorizontalSettings = HorizontalSettings()
    watch: WatchSettings = WatchSettings()
