"""How much of the sea a camera sees, and where it looks."""

from math import asin, atan2, cos, pi, radians, sin, tan
from typing import Annotated, NamedTuple

import msgspec

from messages.cameras import FIRST


class FieldOfView(msgspec.Struct, frozen=True):
    """What a camera's table of a vehicle file says that others than the camera need."""

    # [rad] in water, over the width of the picture. The simulated sea is drawn with it; the page's
    # horizon and heading tape are drawn to fit the picture by it.
    angle: Annotated[float, msgspec.Meta(ge=0.3, le=2.4)] = radians(80.0)
    # How it is mounted, from straight ahead. The pilot's tilt of the first camera comes on top.
    tilt: Annotated[float, msgspec.Meta(ge=-pi / 2, le=pi / 2)] = 0.0  # [rad] + upwards
    yaw: Annotated[float, msgspec.Meta(ge=-pi, le=pi)] = 0.0  # [rad] + to starboard


class Lookout(NamedTuple):
    elevation: float  # [rad] of the camera's axis, + above the horizon
    roll: float  # [rad] of its picture

    def below(self, elevation: float, focal: float) -> float:
        """[px] Below the axis, along the rolled picture, where what has this elevation [rad] is
        seen; `focal` [px]."""
        return focal * tan(self.elevation - elevation)


def lookout(view: FieldOfView, roll: float, pitch: float, tilt: float) -> Lookout:
    """Where a camera looks in a drone with this roll and pitch [rad]; `tilt` [rad]: on top of how
    it is mounted. The same law as `lookout` of the cockpit's page."""
    up, (ahead, aside) = view.tilt + tilt, (cos(view.yaw), sin(view.yaw))
    nose, side, below = -sin(pitch), sin(roll) * cos(pitch), cos(roll) * cos(pitch)  # where down is
    along, across = nose * ahead + side * aside, side * ahead - nose * aside
    down = below * sin(up) - along * cos(up)
    return Lookout(
        asin(max(-1.0, min(1.0, down))), atan2(across, below * cos(up) + along * sin(up))
    )


class CameraViews(FieldOfView, frozen=True):
    """The table [camera] of a vehicle file, as others than the camera read it: the first camera,
    and the further ones by name."""

    more: dict[str, FieldOfView] = msgspec.field(default_factory=dict[str, FieldOfView])

    @property
    def by_name(self) -> dict[str, FieldOfView]:
        """Every camera; the first one first."""
        return {FIRST: self, **self.more}
