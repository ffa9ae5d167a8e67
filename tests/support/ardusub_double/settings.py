"""The parameters that the double has, with the defaults of either version."""

# "4.7-early" is a build of 2025 on the way to 4.7, with some of the new names.
VERSIONS = {"4.5": 0x04050080, "4.7-early": 0x04070000, "4.8": 0x04080000}  # flight_sw_version
_BOTH: dict[str, float] = {
    "FRAME_CONFIG": 2, "FS_PILOT_INPUT": 2, "FS_PILOT_TIMEOUT": 3.0, "FS_GCS_ENABLE": 2,
    "FS_LEAK_ENABLE": 1, "RC_OVERRIDE_TIME": 3.0, "ACRO_YAW_P": 3.375, "MOT_FV_CPLNG_K": 1.0,
    "MOT_SPOOL_TIME": 0.5, "MOT_BAT_CURR_MAX": 0, "BATT_FS_LOW_ACT": 0, "BATT_FS_CRT_ACT": 0,
    "FS_EKF_ACTION": 0, "FS_CRASH_CHECK": 0,
    **{f"MOT_{n}_DIRECTION": 1 for n in range(1, 9)},
    **{f"SERVO{n}_FUNCTION": 32 + n if n <= 8 else 0 for n in range(1, 17)},
    **{
        f"RC{n}_{part}": value
        for n in range(1, 12)
        for part, value in {"MIN": 1100, "TRIM": 1500, "MAX": 1900, "REVERSED": 0}.items()
    },
}  # fmt: skip
_OF_VERSION: dict[str, dict[str, float]] = {
    "4.5": {"SYSID_MYGCS": 255, "SYSID_THISMAV": 1, "ARMING_CHECK": 448, "RC3_TRIM": 1100},
    "4.7-early": {"MAV_GCS_SYSID": 255, "MAV_SYSID": 1, "ARMING_CHECK": 1},
    "4.8": {
        "MAV_GCS_SYSID": 255, "MAV_GCS_SYSID_HI": 0, "MAV_SYSID": 1, "ARMING_SKIPCHK": 16776767,
        "FS_GCS_TIMEOUT": 5.0, "RCMAP_PITCH": 1, "RCMAP_ROLL": 2, "RCMAP_THROTTLE": 3,
        "RCMAP_YAW": 4, "RCMAP_FORWARD": 5, "RCMAP_LATERAL": 6,
    },
}  # fmt: skip
LIMITS = {"FS_PILOT_TIMEOUT": (0.1, 3.0)}  # a value outside is taken as the nearest


def defaults(version: str) -> dict[str, float]:
    """Of 4.5 for any other version, which is too old for the driver."""
    return {**_BOTH, **_OF_VERSION.get(version, _OF_VERSION["4.5"])}
