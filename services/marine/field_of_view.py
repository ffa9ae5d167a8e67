"""How much of the sea a camera sees, and where it looks."""

from math import pi, radians
from typing import Annotated

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


class CameraViews(FieldOfView, frozen=True):
    """The table [camera] of a vehicle file, as others than the camera read it: the first camera,
    and the further ones by name."""

    more: dict[str, FieldOfView] = msgspec.field(default_factory=dict[str, FieldOfView])

    @property
    def by_name(self) -> dict[str, FieldOfView]:
        """Every camera; the first one first."""
        return {FIRST: self, **self.more}
