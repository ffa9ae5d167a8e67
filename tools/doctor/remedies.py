"""What to set a parameter of the board to."""

from contextlib import suppress

from services.ardusub.board_check import CHANNELS, RECOMMENDED_S, Values
from services.ardusub.mixing import FRAMES, NEUTRAL, senses
from services.ardusub.settings import Settings
from services.marine.vehicle import Vehicle

# Those that the board is delivered with, but for the pilot's timeout.
USUAL = {
    "FS_PILOT_INPUT": 2.0, "FS_PILOT_TIMEOUT": RECOMMENDED_S, "FS_GCS_ENABLE": 2.0,
    "FS_LEAK_ENABLE": 1.0, "RC_OVERRIDE_TIME": 3.0, "ACRO_YAW_P": 3.375, "ARMING_CHECK": 448.0,
    "ARMING_SKIPCHK": 16776767.0, "MOT_BAT_CURR_MAX": 0.0,
    **{name: float(channel) for name, channel in CHANNELS.items()},
}  # fmt: skip
OF_CHANNEL = {"MIN": 1100.0, "TRIM": 1500.0, "MAX": 1900.0, "REVERSED": 0.0}
OLD_THROTTLE = "RC3_TRIM"  # in versions whose throttle runs from 0 to 1


def remedy(
    name: str, values: Values, settings: Settings, vehicle: Vehicle, *, new: bool
) -> float | None:
    """A value that is allowed; None where no value is.

    Args:
        values: as read; of a version that is checked.
        new: it has the names of 4.7 and newer.
    """
    if name == "FRAME_CONFIG":
        return _frame_of(vehicle)
    if name in ("MAV_GCS_SYSID", "SYSID_MYGCS"):
        return float(settings.system)
    if name == "FS_PILOT_TIMEOUT" and settings.set_pilot_timeout is not None:
        return settings.set_pilot_timeout
    if name == OLD_THROTTLE and not new:
        return values["RC3_MIN"]
    if name == "RC3_MAX" and not new:
        return 2 * NEUTRAL - values["RC3_MIN"]
    if name.startswith("RC") and "_" in name:
        return USUAL.get(name, OF_CHANNEL.get(name.partition("_")[2]))
    return 1.0 if name.endswith("_DIRECTION") else USUAL.get(name)


def _frame_of(vehicle: Vehicle) -> float | None:
    for number, frame in FRAMES.items():
        with suppress(ValueError):
            senses(frame, vehicle.thruster)
            return float(number)
    return None
