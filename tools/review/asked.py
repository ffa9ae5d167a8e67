"""What Lindy's reference would have asked of the same sticks."""

from typing import NamedTuple

import numpy as np

from messages import topics
from messages.events import Outbox
from messages.pilot import PilotCommand
from services.reference.guidance.axes import Axes
from services.reference.guidance.modes import HELD_AXES
from services.reference.settings import Settings
from tools.analysis.dive import STICKS, RecordedDive
from tools.recordings.columns import Array

RATE = 20.0  # [1/s] of what is drawn


class Asked(NamedTuple):
    """The reference from the first stick to the last, with depth and heading held."""

    t: Array  # [s] since the recording began
    depth_rate: Array  # [m/s]
    yaw_rate: Array  # [rad/s]
    sticks: Array  # (n, 2) [m/s, rad/s] heave and yaw sticks, as the speeds that they mean


def asked(dive: RecordedDive, settings: Settings, depth: float) -> Asked | None:
    """
    Args:
        dive: with the sticks that count.
        depth: [m] at which it begins.

    Returns:
        None: there are no sticks.
    """
    if not dive[topics.PILOT_COMMAND].count:
        return None
    command = dive[topics.PILOT_COMMAND]
    stamps = command["stamp_ns"] / 1e9
    sticks = np.column_stack([command[name] for name in STICKS])
    axes, held = Axes.of(settings, Outbox()), HELD_AXES["stabilised"]
    axes.rest(depth, 0.0, float(stamps[0]))
    grid = np.arange(stamps[0], stamps[-1], 1.0 / RATE)
    rows: list[tuple[float, ...]] = []
    due, last = 0, None
    for now in grid.tolist():
        while due < len(stamps) and stamps[due] <= now:
            wanted = tuple(sticks[due].tolist())
            if wanted != last:
                surge, sway, heave, yaw = last = wanted
                stick = PilotCommand(stamp_ns=0, surge=surge, sway=sway, heave=heave, yaw=yaw)
                axes.aim(stick, held, float(stamps[due]))
            due += 1
        rows.append(
            (axes.heave.at(now).velocity, axes.yaw.at(now).velocity, *(last or (0.0,) * 4)[2:])
        )
    found = np.array(rows).reshape(-1, 4)
    full = (settings.heave.max_velocity, settings.yaw.max_velocity)
    return Asked(grid, found[:, 0], found[:, 1], found[:, 2:] * full)
