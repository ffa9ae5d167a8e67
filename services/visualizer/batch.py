"""What the visualizer draws, independent of any viewer: columns, notes and scene frames.

Times are [ns] since the dive began.
"""

from collections.abc import Iterable, Sequence
from typing import Literal

import msgspec

from messages.cameras import FIRST

Point = tuple[float, float, float]


class CurveColumns(msgspec.Struct, frozen=True, array_like=True):
    """Many samples of one set of curves."""

    path: str
    times: list[int]  # [ns]
    rows: list[Sequence[float]]  # one per time, all of one length


class Note(msgspec.Struct, frozen=True, array_like=True):
    """Something that is shown once: a new state, a log line, a new status page."""

    path: str
    time: int  # [ns]
    kind: Literal["state", "log", "document"]
    text: str
    level: str = "info"


class Frame(msgspec.Struct, frozen=True, array_like=True):
    """The 3-D scene at one moment. World NED, body FRD."""

    time: int  # [ns]
    position: Point  # [m] NED; north and east are 0 where unknown
    attitude: tuple[float, float, float, float]  # [-] q_NB as w, x, y, z
    thrust: list[float]  # [N] per thruster; empty where unknown
    wanted_depth: float | None  # [m] reference
    wanted_heading: float | None  # [rad] reference
    now: Point | None = None  # [m] NED, predicted present position …
    now_heading: float = 0.0  # [rad] … and heading


class VideoSample(msgspec.Struct, frozen=True, array_like=True):
    """A picture of the drone's camera."""

    time: int  # [ns]
    data: bytes  # access unit of H.264, Annex B
    camera: str = FIRST


class Batch(msgspec.Struct, frozen=True, array_like=True):
    """Everything to draw since the last batch."""

    columns: list[CurveColumns] = []
    notes: list[Note] = []
    frames: list[Frame] = []
    video: list[VideoSample] = []
    trail: list[Point] = []  # [m] NED points newly flown, from the last one drawn; none or ≥ 2
    trail_time: int = 0  # [ns] of its last point
    floor: Point | None = None  # [m] NED, where the vehicle has just found the sea floor


def joined_columns(batches: Iterable[Batch]) -> list[CurveColumns]:
    """The columns of several batches, each curve's in one."""
    joined: dict[tuple[str, int], CurveColumns] = {}
    for batch in batches:
        for columns in batch.columns:
            key = columns.path, len(columns.rows[0])
            if (known := joined.get(key)) is None:
                joined[key] = CurveColumns(columns.path, [*columns.times], [*columns.rows])
            else:
                known.times.extend(columns.times)
                known.rows.extend(columns.rows)
    return list(joined.values())
