"""The layout shows what there is: every path names a channel and a field of its schema."""

import json
import re
from pathlib import Path
from typing import Any

from messages import topics
from messages.sensors import DvlSample
from services.estimation.core import AID_SOURCES
from services.marine.vehicle import Vehicle
from services.recorder.foxglove.channel import PREFIX, official, schema_of
from services.recorder.foxglove.views import named_vectors
from services.runtime.config.settings import DEPLOY
from services.runtime.config.stack import Stack

LAYOUT: dict[str, Any] = json.loads(Path(DEPLOY / "foxglove" / "lindy.json").read_text())
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
PATHS = [path["value"] for panel in PANELS.values() for path in panel.get("paths", ())]
THRUSTERS = [thruster.name for thruster in Stack().section("vehicle", Vehicle).thruster]


def schemas() -> dict[str, dict[str, Any]]:
    found = {topic.key: schema_of(topic.message) for topic in topics.ALL}
    found |= {topics.AIDING.of(name).key: found[topics.AIDING.key] for name in AID_SOURCES}
    found |= {vector.key: vector.schema for vector in named_vectors(THRUSTERS).values()}
    drawn = {"pose": "PoseInFrame", "hull": "SceneUpdate", "thrust": "SceneUpdate", "log": "Log"}
    found |= {PREFIX + name: official(f"foxglove.{kind}") for name, kind in drawn.items()}
    return {key: json.loads(schema.data) for key, schema in found.items()}


def test_a_velocity_that_is_not_there_has_no_named_numbers() -> None:
    dvl = named_vectors(THRUSTERS)[topics.DVL.key]
    assert dvl.of(DvlSample(stamp_ns=1, velocity=None, std=0.01)) is None
    seen = dvl.of(DvlSample(stamp_ns=1, velocity=(1.0, 2.0, 3.0), std=0.01))
    assert seen == {"velocity": {"x": 1.0, "y": 2.0, "z": 3.0}}


def test_every_path_names_a_field():
    known = schemas()
    for path in PATHS:
        key, *fields = path.split(".")
        part = known[key]
        for field in fields:
            part = part["properties"][field]
        assert part["type"] in {"number", "integer", "string", "boolean"}
        # What the viewers' grammar takes without quotes.
        assert re.fullmatch(r"[\w/]+(\.\w+)+", path)


def test_every_topic_of_the_scene_and_the_log_is_recorded():
    named = [*PANELS["3D!scene"]["topics"], PANELS["RosOut!log"]["topicToRender"]]
    assert set(named) <= set(schemas())


def test_every_panel_has_its_place():
    def places(part: Any) -> list[str]:
        if isinstance(part, str):
            return [part]
        return places(part["first"]) + places(part["second"])

    assert sorted(places(LAYOUT["layout"])) == sorted(PANELS)
