"""Any message of the dialect with any content, from anybody: it never ends the service."""

from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.pilot import PilotAnswer, RequestKind
from messages.vehicle import VehicleStatus
from services.mavlink.core import Settings, Submarine
from services.mavlink.io.codec import CLASSES, Codec
from services.mavlink.packets import GroundStation, ReceivedPacket
from services.mavlink.telemetry import Snapshot
from services.piloting.pilot import Pilot, Progress

NOBODY = frozenset[RequestKind]()
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


def for_us(packet: ReceivedPacket) -> ReceivedPacket:
    fields = dict(packet.fields)
    for name in {"target", "target_system", "target_component"} & fields.keys():
        fields[name] = 1
    return packet._replace(fields=fields)


class Conversation:
    """A submarine that is armed and hears everything; what it says is put into frames."""

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self._codec = Codec("udp a", 1, self.counts)
        self._submarine = Submarine(Settings(), Pilot(Progress(), arms=False), 0)
        self._status = VehicleStatus(stamp_ns=0, mode="ready", armed=True, epoch=1)
        self._now = 0

    def hear(self, data: bytes) -> int:
        """How many packets were in it."""
        packets = self._codec.decode(data, whole=True)
        for packet in packets:
            self._now += 10_000_000
            for heard in (packet, for_us(packet)):
                self._say(self._submarine.received(heard, NOBODY, self._now))
            self._say(self._submarine.status(self._status, NOBODY, self._now))
            known = Snapshot(self._now, 0, 0, self._status)
            self._say(self._submarine.tick(["udp a"], known, NOBODY, self._now))
        return len(packets)

    def _say(self, reaction: Any) -> None:
        for addressed in reaction.packets:
            assert self._codec.encode(addressed.packet) is not None, addressed
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
    assert not [count for count in talk.counts if count.startswith("does_not_fit")]


@given(st.lists(st.tuples(st.sampled_from(KINDS), st.binary(max_size=255), st.integers(0, 255))))
def test_any_messages_at_all(said: list[tuple[Any, bytes, int]]) -> None:
    talk = Conversation()
    for kind, content, system in said:
        payload = content[: kind.unpacker.size]
        talk.hear(frame(kind, payload, system))
    assert not [count for count in talk.counts if count.startswith("does_not_fit")]


def test_a_ground_station_is_known_by_its_ids_and_its_link() -> None:
    heard = Codec("udp a", 1, Counter()).decode(
        frame(CLASSES["HEARTBEAT"], bytes(9), 7), whole=True
    )
    assert heard[0].sender == GroundStation("udp a", 7, 190)
