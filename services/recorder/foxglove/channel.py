"""Channels of an MCAP file or of a live server that hold views: messages in the form that Foxglove
shows, computed from the messages of the bus."""

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

from messages.message import Message
from services.recorder.foxglove_schema import Schema, foxglove_schema

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
