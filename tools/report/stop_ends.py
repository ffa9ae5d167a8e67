"""What moves the reference after a stick was let go, so that its stop is over."""

import numpy as np
from numpy.typing import NDArray

from messages import topics
from tools.recordings.columns import Array
from tools.report.columns import FAILSAFES, FLIGHT_MODES, REACTIONS
from tools.report.dive import RecordedDive

# A drone that only comes to rest and holds goes on with the same stop; these reactions move it.
MOVING = [REACTIONS.index("ascend"), REACTIONS.index("surface")]
ALTITUDE_HOLD = FLIGHT_MODES.index("altitude_hold")
NO_ESTIMATE = [FAILSAFES.index("state_lost"), FAILSAFES.index("imu_lost")]


def stop_ends(dive: RecordedDive, axis: str) -> Array:
    """[ns] Ascending: every instant at which a failsafe, a path of the drone's own or another
    flight mode moves the reference, or the estimate it is compared with jumps or is not valid.

    Args:
        axis: heave or yaw.
    """
    status, state = dive[topics.STATUS], dive[topics.STATE]
    moving = (
        np.isin(status["reaction"], MOVING)
        | np.isin(status["failsafe"], NO_ESTIMATE)
        | (status["own way"] > 0)
        | _changed(status["flight mode"])
    )
    unknown = state[f"{axis} known"] == 0
    if axis == "heave":
        moving = moving | (status["flight mode"] == ALTITUDE_HOLD)  # the bottom does
        unknown = unknown | _changed(state["moved"])
    return np.sort(np.concatenate([status["stamp"][moving], state["sensor"][unknown]]))


def _changed(values: Array) -> NDArray[np.bool_]:
    """Of each value: does it differ from the one before?"""
    return np.diff(values, prepend=values[:1]) != 0.0
