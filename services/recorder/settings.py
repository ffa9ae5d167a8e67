"""Settings of the recorder: the table [recorder] of a vehicle file."""

import msgspec


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is recorded beside the messages."""

    foxglove: bool = True  # record what Foxglove shows as well
