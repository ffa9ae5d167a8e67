"""How much of the sea a camera sees."""

from math import radians
from typing import Annotated

import msgspec


class FieldOfView(msgspec.Struct, frozen=True):
    """What `[camera]` of a vehicle file says that others than the camera need."""

    # [rad] in water, over the width of the picture. The simulated sea is drawn with it; the page's
    # horizon and heading tape are drawn to fit the picture by it.
    angle: Annotated[float, msgspec.Meta(ge=0.3, le=2.4)] = radians(80.0)
