"""Recordings of an older Lindy, whose messages had other names of fields, read like today's."""

import json
from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.message import Message
from messages.pilot import PilotRequest
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.recorder.foxglove_schema import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from tools.recordings.older_names import RENAMED
from tools.recordings.recording import open_recording

MESSAGES: list[tuple[AnyTopic, Message]] = [
    (topics.STATUS, VehicleStatus(stamp_ns=5, activity="goto", armed=True, flight_mode="manual")),
    (topics.PILOT_REQUEST, PilotRequest(stamp_ns=5, id="a", kind="mode", flight_mode="depth_hold")),
]


def with_older_names(topic: AnyTopic, text: bytes) -> bytes:
    for old, new in RENAMED[topic.message.__name__].items():
        text = text.replace(f'"{new}"'.encode(), f'"{old}"'.encode())
    return text


@pytest.mark.parametrize(("topic", "message"), MESSAGES)
@pytest.mark.parametrize("older", [True, False])
def test_an_older_recording_reads_like_todays(
    tmp_path: Path, topic: AnyTopic, message: Message, older: bool
) -> None:
    path = tmp_path / "dive.mcap"
    file = McapFile(path)
    data, schema = msgspec.json.encode(message), foxglove_schema(topic.message)
    if older:
        before = data
        data, schema = with_older_names(topic, data), with_older_names(topic, schema)
        assert data != before
    file.open_channel(topic.key, topic.message.__name__, schema)
    file.write(topic.key, data, 5, 5, 0)
    file.write(topic.key, b"no JSON", 6, 6, 0)
    file.finish()
    recording = open_recording(path)
    assert [each.message for each in recording] == [message]
    assert recording.unreadable == {topic.key: 1}
    assert json.loads(next(recording.raw()).data) == json.loads(msgspec.json.encode(message))
