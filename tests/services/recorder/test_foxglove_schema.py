"""What Foxglove's parser demands of a schema holds for every message type."""

import json
from typing import Any

import msgspec

from messages import topics
from messages.message import Message
from services.recorder.foxglove.channel import foxglove_schema

KINDS = sorted({topic.message for topic in topics.ALL}, key=lambda kind: kind.__name__)
REFUSED = {"$ref", "$defs", "anyOf", "oneOf", "enum", "prefixItems"}
TYPES = {"object", "array", "string", "number", "integer", "boolean"}


def schema_of(kind: type[Message]) -> dict[str, Any]:
    return json.loads(foxglove_schema(kind))


def parts_of(schema: dict[str, Any]) -> list[dict[str, Any]]:
    inner = [*schema.get("properties", {}).values()]
    inner += [schema[name] for name in ("items", "additionalProperties") if name in schema]
    return [schema, *(part for child in inner for part in parts_of(child))]


def test_every_part_has_a_plain_type_and_nothing_the_parser_refuses():
    for kind in KINDS:
        schema = schema_of(kind)
        assert schema["type"] == "object"
        assert set(schema["properties"]) == {f.encode_name for f in msgspec.structs.fields(kind)}
        for part in parts_of(schema):
            assert part["type"] in TYPES
            assert part["type"] != "object" or "properties" in part
            assert part["type"] != "array" or part["items"]["type"] != "array"
            assert not REFUSED & set(part)
