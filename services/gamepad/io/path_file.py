"""A path file as a course that the drone can follow."""

from math import exp
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from messages.pilot import Course, Place
from messages.units import PathQuantity
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file, read

Waypoints = Annotated[tuple[Place, ...], msgspec.Meta(min_length=2, max_length=1000)]


class PathFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The keys of a file in deploy/paths; the same as those of `lindy path`."""

    waypoints: Waypoints  # [m] [north, east] or [north, east, down]
    min_radius: PathQuantity = 5.0  # [m] of every turn
    kind: Literal["approximating", "interpolating"] = "approximating"
    cruise: PathQuantity = 0.3  # [m/s]
    acceleration: PathQuantity = 0.15  # [m/s²] at most
    jerk: PathQuantity = 0.3  # [m/s³] at most
    model: Literal["mjvr", "fernandes"] = "mjvr"  # how the speed changes
    speeds: list[PathQuantity] = []  # [m/s] of each part, instead of `cruise`
    # Ignored on board: the turns of a followed path are always smooth in yaw, and the other keys
    # belong to the model `fernandes`.
    smooth_yaw: bool = False
    accel_time: PathQuantity = 20.0  # [s]
    decel_time: PathQuantity = 20.0  # [s]
    epsilon: float = 0.05  # [-]
    theta_a: float = 0.8  # [-]
    theta_d: float = 0.2  # [-]
    theta_0: float = exp(-100 / 9)  # [-]
    xi: float = 15.0  # [-]


def course_of(path: Path) -> Course:
    """The course in a path file. The drone checks whether the turns fit between the waypoints.

    Raises:
        LindyError: the file cannot be read, a key of it is wrong, or it asks for a motion that
            only `lindy path` can show.
    """
    file = read(path, PathFile)
    if file.model != "mjvr":
        raise LindyError(
            f"{path}: model is {file.model!r}; only a path with model = 'mjvr' can be followed "
            "on board"
        )
    if file.speeds:
        raise LindyError(
            f"{path}: speeds: a path that is followed on board has one speed; use cruise instead"
        )
    return Course(
        waypoints=file.waypoints,
        min_radius=file.min_radius,
        kind=file.kind,
        cruise=file.cruise,
        acceleration=file.acceleration,
        jerk=file.jerk,
    )


def course_named(name: str) -> Course:
    """The course in a file of deploy/paths, or in any TOML file, as an event of a script names it.

    Raises:
        ValueError: as `course_of`, or there is no such file.
    """
    try:
        return course_of(deploy_file("paths", name))
    except LindyError as error:
        raise ValueError(str(error)) from None
