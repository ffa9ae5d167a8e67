"""Any message of the dialect with any content, from anybody: it never ends the service."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import PilotAnswer
from messages.vehicle import VehicleStatus
from services.mavlink.core import Settings, Submarine
from services.mavlink.telemetry import Snapshot
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec
from services.mavlink_io.packet import MavlinkPacket
from services.piloting.pilot import Pilot, Progress

CODEC = MavlinkCodec(1, 1, "ardupilotmega")
CLASSES = CODEC.types
KINDS: list[Any] = sorted(CLASSES.values(), key=lambda kind: kind.id)
OBEYED = (
    "MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE", "COMMAND_LONG", "COMMAND_INT", "SET_MODE",
    "REQUEST_DATA_STREAM", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET", "TIMESYNC",
    "PING", "FILE_TRANSFER_PROTOCOL", "MISSION_REQUEST_LIST",
)  # fmt: skip


def frame(kind: Any, payload: bytes, system: int) -> bytes:
    """A frame with this content, its checksum right."""
    from pymavlink.generator.mavcrc import x25crc  # pyright: ignore[reportMissingTypeStubs]

    head = bytes([len(payload), 0, 0, 0, system, 190]) + int(kind.id).to_bytes(3, "little")
    check: Any = x25crc(head + payload + bytes([kind.crc_extra]))
    return b"\xfd" + head + payload + int(check.crc).to_bytes(2, "little")


def for_us(packet: MavlinkPacket) -> MavlinkPacket:
    fields = dict(packet.fields)
    for name in {"target", "target_system", "target_component"} & fields.keys():
        fields[name] = 1
    return packet._replace(fields=fields)


class Conversation:
    """A submarine that is armed and hears everything; what it says is put into frames."""

    def __init__(self) -> None:
        self._reader = FrameReader(CODEC)
        self._submarine = Submarine(Settings(), Pilot(Progress(), Outbox(), arms=False), 0)
        self._status = VehicleStatus(stamp_ns=0, activity="ready", armed=True, epoch=1)
        self._now = 0

    def hear(self, data: bytes) -> int:
        """How many packets were in it."""
        packets = self._reader.read([data], datagrams=True, link="udp a")
        for packet in packets:
            self._now += 10_000_000
            for heard in (packet, for_us(packet)):
                self._say(self._submarine.received(heard, self._now))
            self._say(self._submarine.status(self._status, self._now))
            known = Snapshot(self._now, 0, 0, self._status)
            self._say(self._submarine.tick(["udp a"], known, self._now))
        return len(packets)

    def _say(self, reaction: Any) -> None:
        for addressed in reaction.packets:
            CODEC.encode(addressed.packet)  # it fits
        for request in reaction.requests:
            granted = PilotAnswer(stamp_ns=0, id="", accepted=True, epoch=None)
            self._say(self._submarine.answered(request, granted, self._now))


@pytest.mark.parametrize("name", OBEYED)
@given(data=st.data())
def test_any_content_of_a_message_that_is_obeyed(name: str, data: st.DataObject) -> None:
    length = CLASSES[name].unpacker.size
    payloads = st.lists(st.binary(min_size=length, max_size=length), min_size=1, max_size=5)
    talk = Conversation()
    for payload in data.draw(payloads):
        assert talk.hear(frame(CLASSES[name], payload, 255)) == 1


@given(st.lists(st.tuples(st.sampled_from(KINDS), st.binary(max_size=255), st.integers(0, 255))))
def test_any_messages_at_all(said: list[tuple[Any, bytes, int]]) -> None:
    talk = Conversation()
    for kind, content, system in said:
        payload = content[: kind.unpacker.size]
        talk.hear(frame(kind, payload, system))
