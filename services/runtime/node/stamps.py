"""Which fields of a message are stamps, and how they are converted to another clock.

The type decides: every field of type `Stamp` (messages/units.py), or of it and None, is shifted;
everything else, including durations and what stands deeper, stays as it is. A test says of which
messages that is not all.
"""

from collections.abc import Callable
from functools import cache

from msgspec import inspect
from msgspec.structs import force_setattr

from messages.message import Message
from messages.units import STAMP


@cache
def mover(kind: type[Message]) -> Callable[[Message, int], None]:
    """A function that subtracts `ahead_ns` [ns] from every stamp of a message just decoded.

    Made once for each message type, because thousands of messages are converted every second.
    """
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    names = tuple(field.name for field in info.fields if _is_stamp(field.type))

    def move(message: Message, ahead_ns: int) -> None:
        # Frozen for everybody else; nobody else has it yet.
        for name in names:
            moment = getattr(message, name)
            if moment is not None:
                force_setattr(message, name, moment - ahead_ns)

    return move


def _is_stamp(kind: inspect.Type) -> bool:
    if isinstance(kind, inspect.UnionType):
        return any(map(_is_stamp, kind.types))
    return isinstance(kind, inspect.Metadata) and kind.extra == STAMP
