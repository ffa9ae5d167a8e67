"""What the drone did by itself: each failsafe with its times, from the recorded status."""

from typing import cast

import msgspec
import numpy as np

from messages import topics
from messages.vehicle import Failsafe, Reaction
from tools.analysis.dive import RecordedDive


class ActedReaction(msgspec.Struct, frozen=True):
    """One reaction, from its beginning to the next change."""

    condition: Failsafe
    reaction: Reaction
    t: float  # [s] since the first arming
    seconds: float  # [s] that it lasted, or until the last status
    noticed: float | None = None  # [s] since the first arming, of the beginning of the condition


def failsafes(dive: RecordedDive) -> list[ActedReaction]:
    """All reactions in order of time; none on a dive without arming."""
    status, armed = dive[topics.STATUS], dive.armed
    if armed is None or not status.count:
        return []
    stamp, acting, doing = status["stamp_ns"], status["failsafe"], status["reaction"]
    acts = ~status.said("failsafe", "none") & np.isfinite(doing)
    changed = (np.diff(acting) != 0) | (np.diff(np.nan_to_num(doing, nan=-1.0)) != 0)
    begins = [0, *(np.flatnonzero(changed) + 1).tolist()]
    ends = [*begins[1:], status.count - 1]
    return [
        ActedReaction(
            condition=cast(Failsafe, status.words[int(acting[begin])]),
            reaction=cast(Reaction, status.words[int(doing[begin])]),
            t=float(stamp[begin] - armed[0]) / 1e9,
            seconds=float(stamp[end] - stamp[begin]) / 1e9,
            noticed=float(since - armed[0]) / 1e9 if np.isfinite(since) else None,
        )
        for begin, end, since in zip(begins, ends, status["since_ns"][begins], strict=True)
        if acts[begin]
    ]
