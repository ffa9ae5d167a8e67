"""What is shown besides messages: the settings of the dive, as parameters that nobody can set."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, cast

import msgspec

LOOPBACK = ("127.0.0.1", "::1", "localhost")
Value = bool | int | float | str


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [foxglove] of a vehicle file."""

    host: str = "127.0.0.1"  # address to listen on: only this machine; 0.0.0.0 is everywhere
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 8765


def parameters(tree: Mapping[str, Any]) -> dict[str, Value]:
    """The settings of a vehicle file by their dotted names; entries of an array are numbered
    from 0."""
    return dict(_flat("", tree))


def _flat(name: str, value: Any) -> Iterator[tuple[str, Value]]:
    if isinstance(value, Mapping):
        inner = cast(Mapping[str, Any], value).items()
    elif isinstance(value, list | tuple):
        inner = enumerate(cast(list[Any], value))
    else:
        yield name, value if isinstance(value, Value) else str(value)
        return
    for key, part in inner:
        yield from _flat(f"{name}.{key}" if name else str(key), part)
