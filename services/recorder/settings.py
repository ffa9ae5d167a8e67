"""Settings of the recorder: the table [recorder] of a vehicle file."""

from typing import Annotated

import msgspec

from messages.units import Positive

Megabytes = Annotated[float, msgspec.Meta(ge=1.0, le=1e6)]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When a recording begins, and when it goes on in the next file."""

    part_size: Megabytes | None = None  # [MB] a larger file is ended and the next one begun
    part_time: Positive | None = None  # [min] the same by time
    ring: Annotated[float, msgspec.Meta(ge=0.0, le=600.0)] = 0.0  # [s] kept before a trigger; 0: no
    ring_size: Megabytes = 64.0  # [MB] of memory that the ring may take
    foxglove: bool = True  # record what Foxglove shows as well
