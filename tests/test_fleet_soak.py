"""What the soak of a fleet finds in the recording of a drone: others' commands, and old ones."""

from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.message import Message
from messages.pilot import PilotCommand
from messages.reference import Motion, Reference
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.recorder.foxglove_schema import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from tests.long.fleet_soak import STALE_NS, DroneRead, own_missing, read

AT = 10**12  # [ns]
REST = Motion(0.0, 0.0, 0.0, 0.0)


def recorded(folder: Path, *said: tuple[AnyTopic, Message]) -> Path:
    file = McapFile(folder / "dive.mcap")
    file.metadata("dive", {"vehicle": "pioneer", "link": "tether"})
    for topic, message in said:
        if not file.has_channel(topic.key):
            kind = type(message)
            file.open_channel(topic.key, kind.__name__, foxglove_schema(kind))
        data = msgspec.json.encode(message)
        file.write(topic.key, data, message.stamp_ns, message.stamp_ns, message.seq)
    file.finish()
    return folder


def command(seq: int, source: str) -> tuple[AnyTopic, Message]:
    return topics.PILOT_COMMAND, PilotCommand(
        seq=seq, stamp_ns=AT, source=source, surge=0.0, sway=0.0, heave=0.0, yaw=0.0
    )


def reference(seq: int, age_ns: int) -> tuple[AnyTopic, Message]:
    return topics.REFERENCE, Reference(
        seq=seq, stamp_ns=AT, sensor_ns=AT, pilot_ns=AT - age_ns, armed=True, depth=REST,
        heading=REST, surge_force=0.0, sway_force=0.0,
    )  # fmt: skip


def status(seq: int, pilot: str) -> tuple[AnyTopic, Message]:
    return topics.STATUS, VehicleStatus(
        seq=seq, stamp_ns=AT, activity="piloted", armed=True, pilot=pilot
    )


def test_a_drones_own_pilots_and_fresh_commands_are_well(tmp_path: Path) -> None:
    folder = recorded(
        tmp_path, command(1, "script desk0-rov1-0"), status(1, "script desk0-rov1-0"),
        status(2, ""), status(3, "script desk1-rov1-4"), reference(1, STALE_NS),
    )  # fmt: skip
    assert read(folder, "rov1") == DroneRead(1, 0, 0, 1, 2)
    assert own_missing(folder) == 0


@pytest.mark.parametrize("said", [command(1, "script desk0-rov11-0"), status(1, "desk0-rov2-0")])
def test_what_another_drones_pilot_did_is_found(
    tmp_path: Path, said: tuple[AnyTopic, Message]
) -> None:
    assert read(recorded(tmp_path, said), "rov1").mixed_up == 1


def test_a_command_that_acts_too_late_and_a_message_that_is_missing_are_found(
    tmp_path: Path,
) -> None:
    folder = recorded(tmp_path, reference(1, 0), reference(4, STALE_NS + 1))
    assert read(folder, "rov1").stale == 1
    assert own_missing(folder) == 2
