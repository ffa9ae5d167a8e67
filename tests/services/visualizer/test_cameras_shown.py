"""Pictures of several cameras, whose parts come among each other, in the viewer and in Foxglove."""

import json
from base64 import b64decode

from hypothesis import given
from hypothesis import strategies as st

from messages import cameras, topics
from messages.video import VideoPart
from services.marine.vehicle import Vehicle
from services.recorder.foxglove.views import Views
from services.runtime.config.stack import Stack
from services.visualizer.core import Collector

VEHICLE = Stack(vehicle="pioneer").section("vehicle", Vehicle)
SECOND = 1_000_000_000
PARTS = 3


@given(st.permutations([*"fffddd"]))
def test_each_picture_is_put_together_of_its_own_cameras_parts(order: list[str]) -> None:
    """Two cameras may number and stamp their pictures alike."""
    names = {"f": "front", "d": "down"}
    coming = {
        name: iter([
            VideoPart(
                stamp_ns=SECOND, picture=1, keyframe=True, part=part, parts=PARTS, width=64,
                height=64, captured_ns=SECOND, encoded_ns=SECOND, budget_kbit=100.0,
                data=f"{name}{part} ".encode(),
            )
            for part in range(PARTS)
        ])
        for name in names.values()
    }  # fmt: skip
    collector, views = Collector(VEHICLE), Views(VEHICLE)
    shown = dict[str, bytes]()
    for letter in order:
        name = names[letter]
        part, key = next(coming[name]), cameras.video(name).key
        topic = topics.find(key)
        assert topic is not None
        assert collector.hear(topic, key, part, SECOND) is None
        for view in views.of(topic, part, SECOND, key):
            shown[view.key] = b64decode(json.loads(view.data)["data"])
    whole = {name: "".join(f"{name}{k} " for k in range(PARTS)).encode() for name in coming}
    drawn = {sample.camera: sample.data for sample in collector.drain(SECOND).video}
    assert drawn == whole
    assert shown == {"foxglove/camera": whole["front"], "foxglove/camera_down": whole["down"]}
