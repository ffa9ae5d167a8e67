"""Fields of messages that an older Lindy called otherwise: its recordings read like today's."""

from collections.abc import Callable
from typing import Any, cast

import msgspec
from mcap.records import Schema

from messages.payload import UNDECODABLE

RENAMED: dict[str, dict[str, str]] = {
    "VehicleStatus": {"mode": "activity", "hold": "flight_mode"},
    "PilotRequest": {"hold": "flight_mode"},
}  # message → older name of a field → its name today


def as_today(schema: Schema) -> Callable[[bytes], bytes] | None:
    """What gives a message of that schema, as JSON, today's names; None: it has them."""
    names = {
        old: new
        for old, new in RENAMED.get(schema.name, {}).items()
        if f'"{new}"'.encode() not in schema.data
    }
    if not names:
        return None

    def renamed(data: bytes) -> bytes:
        try:
            return msgspec.json.encode(_renamed(msgspec.json.decode(data), names))
        except UNDECODABLE:
            return data  # whoever decodes it counts it

    return renamed


def _renamed(tree: Any, names: dict[str, str]) -> Any:
    if isinstance(tree, list):
        return [_renamed(each, names) for each in cast(list[Any], tree)]
    if isinstance(tree, dict):
        items = cast(dict[str, Any], tree).items()
        return {names.get(key, key): _renamed(value, names) for key, value in items}
    return tree
