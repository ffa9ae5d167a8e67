"""Which fields of a message are stamps, and how they are converted to another clock.

The type decides: every field, or part of a field, of type `Stamp` (messages/units.py) is shifted;
everything else, including durations, stays as it is.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import msgspec
from msgspec import inspect
from msgspec.structs import force_setattr

from messages.message import Message
from messages.units import STAMP

# Shifts a value by [ns]; by the class of the value, because a field may have several.
Shift = Callable[[Any, int], Any]
Shifts = dict[type, Shift]


@cache
def mover(kind: type[Message]) -> Callable[[Message, int], None]:
    """A function that subtracts `ahead_ns` [ns] from every stamp of a message just decoded.

    Made once for each message type, because thousands of messages are converted every second.
    """
    fields = _fields(kind)
    own = tuple(name for name, shifts in fields.items() if shifts == {int: _earlier})
    within = tuple((name, shifts) for name, shifts in fields.items() if name not in own)

    def move_own(message: Message, ahead_ns: int) -> None:
        # Frozen for everybody else; nobody else has it yet.
        for name in own:
            moment = getattr(message, name)
            if moment is not None:
                force_setattr(message, name, moment - ahead_ns)

    def move_all(message: Message, ahead_ns: int) -> None:
        move_own(message, ahead_ns)
        # A part that was not sent is the default, which all messages share: parts are copied.
        for name, shifts in within:
            force_setattr(message, name, _shifted(getattr(message, name), shifts, ahead_ns))

    return move_all if within else move_own


def _earlier(moment: int, ahead_ns: int) -> int:
    return moment - ahead_ns


def _shifted(value: object, shifts: Shifts, ahead_ns: int) -> Any:
    shift = shifts.get(type(value))
    return value if shift is None else shift(value, ahead_ns)


def _fields(kind: type[msgspec.Struct]) -> dict[str, Shifts]:
    """The fields that are stamps or hold some."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    found = {field.name: _shifts(field.type) for field in info.fields}
    return {name: shifts for name, shifts in found.items() if shifts}


def _shifts(kind: inspect.Type) -> Shifts:
    """How values of a type are shifted; empty where they hold no stamps."""
    match kind:
        case inspect.Metadata():
            return {int: _earlier} if kind.extra == STAMP else _shifts(kind.type)
        case inspect.UnionType(types=kinds):
            return {cls: shift for each in kinds for cls, shift in _shifts(each).items()}
        case inspect.StructType(cls=cls):
            return _of_struct(cls)
        case inspect.TupleType(item_types=kinds):
            return _of_tuple([_shifts(each) for each in kinds])
        case inspect.ListType(item_type=item):
            return _of_items(list, _shifts(item))
        case inspect.VarTupleType(item_type=item):
            return _of_items(tuple, _shifts(item))
        case inspect.DictType(value_type=item):
            return _of_values(_shifts(item))
        case _:
            return {}


def _of_struct(cls: type[msgspec.Struct]) -> Shifts:
    fields = _fields(cls)

    def shift(value: msgspec.Struct, ahead_ns: int) -> msgspec.Struct:
        moved = {name: _shifted(getattr(value, name), s, ahead_ns) for name, s in fields.items()}
        return msgspec.structs.replace(value, **moved)

    return {cls: shift} if fields else {}


def _of_tuple(items: list[Shifts]) -> Shifts:
    def shift(value: tuple[Any, ...], ahead_ns: int) -> tuple[Any, ...]:
        return tuple(_shifted(v, s, ahead_ns) for v, s in zip(value, items, strict=True))

    return {tuple: shift} if any(items) else {}


def _of_items(cls: type, item: Shifts) -> Shifts:
    def shift(value: Any, ahead_ns: int) -> Any:
        return cls(_shifted(v, item, ahead_ns) for v in value)

    return {cls: shift} if item else {}


def _of_values(item: Shifts) -> Shifts:
    def shift(value: dict[Any, Any], ahead_ns: int) -> dict[Any, Any]:
        return {key: _shifted(v, item, ahead_ns) for key, v in value.items()}

    return {dict: shift} if item else {}
