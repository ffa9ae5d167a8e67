"""Where Foxglove's server listens."""

from typing import Annotated

import msgspec

LOOPBACK = ("127.0.0.1", "::1", "localhost")


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [foxglove] of a vehicle file."""

    host: str = "127.0.0.1"  # address to listen on: only this machine; 0.0.0.0 is everywhere
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 8765
