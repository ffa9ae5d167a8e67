"""Vectors with a name for each component: `wanted.heave` instead of `wanted[2]`, and the thrust of
each thruster under the thruster's own name."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from messages import topics
from messages.message import Message
from messages.topic import AnyTopic
from services.recorder.foxglove.channel import PREFIX, NamedSchema

AXES = ("x", "y", "z")  # of a sensor
EARTH = ("north", "east", "down")
BODY = ("surge", "sway", "heave")
RATES = ("roll", "pitch", "yaw")
Names = Mapping[str, Sequence[str]]  # field of a message → names of its components

VECTORS: dict[AnyTopic, Names] = {
    topics.IMU: {"specific_force": AXES, "angular_rate": AXES},
    topics.MAGNETOMETER: {"field": AXES},
    topics.DVL: {"velocity": AXES},
    topics.WRENCH: dict.fromkeys(("wanted", "achieved", "disturbance"), (*BODY, *RATES)),
    topics.TRUTH: {
        "position": EARTH,
        "velocity": BODY,
        "angular_rate": RATES,
        "current": EARTH,
        "tether_pull": EARTH,
    },
}
THRUST = (topics.THRUSTERS, topics.ACTUATION)  # their `thrust` is in the order of the vehicle file


class NamedVectors:
    """The named fields of one topic."""

    def __init__(self, topic: AnyTopic, names: Names) -> None:
        self.key = f"{PREFIX}plot/{topic.key}"
        self.schema = NamedSchema(f"Named{topic.message.__name__}", _schema(names))
        self._names = names

    def of(self, message: Message) -> dict[str, dict[str, float]] | None:
        """The same numbers under their names; None for a message with too many, too few or none."""
        named: dict[str, dict[str, float]] = {}
        for field, names in self._names.items():
            values: Sequence[float] | None = getattr(message, field)
            if values is None or len(values) != len(names):
                return None
            named[field] = dict(zip(names, values, strict=True))
        return named


def named_vectors(thrusters: Sequence[str]) -> dict[str, NamedVectors]:
    """By key of the topic.

    Args:
        thrusters: their names, in the order of the vehicle file.
    """
    vectors = VECTORS | {topic: {"thrust": thrusters} for topic in THRUST}
    return {topic.key: NamedVectors(topic, names) for topic, names in vectors.items()}


def _schema(names: Names) -> bytes:
    def vector(components: Sequence[str]) -> dict[str, Any]:
        return {"type": "object", "properties": {name: {"type": "number"} for name in components}}

    properties = {field: vector(components) for field, components in names.items()}
    return json.dumps({"type": "object", "properties": properties}).encode()
