"""What a board's parameters may be, but had better not be."""

from collections.abc import Mapping

RECOMMENDED_S = 1.0  # [s] of FS_PILOT_TIMEOUT
LEAST = 1e-3  # [s] values travel as 32-bit floats
NOTHING, DISARM = 0, 2  # actions
# Read where the board has them.
OPTIONAL = ("BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT", "FS_EKF_ACTION", "FS_CRASH_CHECK")


def advice(values: Mapping[str, float]) -> list[str]:
    """One sentence each: parameter, found, what follows, recommended."""
    found = list[str]()
    if (timeout := values["FS_PILOT_TIMEOUT"]) > RECOMMENDED_S + LEAST:
        found.append(
            f"FS_PILOT_TIMEOUT is {timeout:g} s: if this computer dies the motors go on for so "
            f"long; recommended: at most {RECOMMENDED_S:g} s"
        )
    for name in ("BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"):
        if values.get(name) == DISARM:
            found.append(
                f"{name} is 2: the board stops all motors when its battery runs low, at whatever "
                f"depth; recommended: 3 (surface) or 0 (Lindy's own failsafe rises)"
            )
    for name, judge in (("FS_EKF_ACTION", "own estimator, which Lindy does not use,"),
                        ("FS_CRASH_CHECK", "crash check")):  # fmt: skip
        if values.get(name) == DISARM:
            found.append(
                f"{name} is 2: the board's {judge} may disarm it in mid-dive; recommended: 0 or 1"
            )
    return found
