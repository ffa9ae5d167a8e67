"""Channels of an MCAP file or of a live server, also those of views: messages in the form that
Foxglove shows, computed from the messages of the bus.

Foxglove's and Lichtblick's parser of JSON Schemas needs `"type": "object"` at the top and supports
neither `$ref`, `anyOf`, `enum` nor `prefixItems`, nor an object without `properties`, nor an array
of arrays; a channel whose schema has one of them is not shown. So schemas are flattened: references
are replaced by their target, a nullable value by the value, an enumeration by its type, a tuple by
an array of its first item. An object whose keys are not known beforehand, such as the counts of a
service, has no named properties, and a field that is an array of arrays is left out.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from messages.message import Message

Schema = dict[str, Any]


@cache
def foxglove_schema(kind: type[Message]) -> bytes:
    """The schema of a message type, as JSON text."""
    schema = msgspec.json.schema(kind)
    return json.dumps(_flat(schema, schema.get("$defs", {}))).encode()


def _flat(schema: Schema, defs: dict[str, Schema]) -> Schema:
    if "$ref" in schema:
        return _flat(defs[schema["$ref"].rpartition("/")[2]], defs)
    if "anyOf" in schema:
        return _flat(next(s for s in schema["anyOf"] if s.get("type") != "null"), defs)
    if "enum" in schema:
        return {"type": "string" if isinstance(schema["enum"][0], str) else "integer"}
    if "prefixItems" in schema:
        return {"type": "array", "items": _flat(schema["prefixItems"][0], defs)}
    flat = {name: value for name, value in schema.items() if name != "$defs"}
    for name in ("items", "additionalProperties"):
        if isinstance(flat.get(name), dict):
            flat[name] = _flat(flat[name], defs)
    if flat.get("type") == "object":
        flat.setdefault("properties", {})
    if "properties" in flat:
        parts = {k: _flat(s, defs) for k, s in flat["properties"].items()}
        flat["properties"] = {k: part for k, part in parts.items() if not _is_nested(part)}
    return flat


def _is_nested(schema: Schema) -> bool:
    """Is it an array of arrays?"""
    return schema["type"] == "array" and schema["items"]["type"] == "array"


PREFIX = "foxglove/"  # of the channels of views; no topic of the bus begins like this
# Schemas of Foxglove's own message types, published under the MIT licence by
# https://github.com/foxglove/foxglove-sdk (npm package @foxglove/schemas 2.1.0), without their
# descriptions. Foxglove knows them by their names.
OFFICIAL: dict[str, Schema] = json.loads(
    Path(__file__).with_name("official_schemas.json").read_text()
)


class NamedSchema(NamedTuple):
    """What a channel says of its messages."""

    name: str
    data: bytes  # JSON Schema


def is_view(key: str) -> bool:
    """Is it the channel of a view, and not of a topic?"""
    return key.startswith(PREFIX)


@cache
def schema_of(kind: type[Message]) -> NamedSchema:
    """The schema of a message type of the bus."""
    return NamedSchema(kind.__name__, foxglove_schema(kind))


@cache
def official(name: str) -> NamedSchema:
    """The schema of one of Foxglove's own types, such as `foxglove.Log`."""
    return NamedSchema(name, json.dumps(OFFICIAL[name]).encode())


class FoxgloveView(NamedTuple):
    """One message for Foxglove."""

    key: str
    schema: NamedSchema
    data: bytes  # JSON
