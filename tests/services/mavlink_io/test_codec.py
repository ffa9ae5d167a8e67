"""Frames, and what is none: counted, and nothing else happens."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import (  # pyright: ignore[reportMissingTypeStubs]
    ardupilotmega as dialect,
)

from messages.events import Outbox
from services.mavlink_io.io.endpoint import (
    LONGEST,
    MOST,
    FrameCutter,
    FrameReader,
    HeardMessages,
    MavlinkCodec,
)
from services.mavlink_io.packet import MavlinkPacket, command, heartbeat

CODEC = MavlinkCodec(1, 1)
STICKS = MavlinkPacket(
    "MANUAL_CONTROL", {"target": 1, "x": 1, "y": 2, "z": 500, "r": 3, "buttons": 4}
)
SOME = [
    heartbeat(),
    command(1, 400, 1.0),
    STICKS,
    MavlinkPacket("STATUSTEXT", {"severity": 2, "text": "Leak Detected"}),
    MavlinkPacket("PARAM_VALUE", {"param_id": "FRAME_CONFIG", "param_value": 2.0, "param_type": 9,
                           "param_count": 10, "param_index": 1}),
]  # fmt: skip
GROUND = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
packets = st.lists(st.sampled_from(SOME), max_size=6)
cuts = st.lists(st.integers(1, 40), max_size=40)


class Reading:
    """A reader, and what it counts."""

    def __init__(self, heard: HeardMessages | None = None) -> None:
        self.outbox = Outbox()
        self._reader = FrameReader(CODEC, self.outbox, heard)

    def read(self, *pieces: bytes, datagrams: bool = False) -> list[MavlinkPacket]:
        return self._reader.read(pieces, datagrams=datagrams, link="udp test")

    @property
    def counts(self) -> Counter[str]:
        return self.outbox.counts


def frames(sent: list[MavlinkPacket]) -> bytes:
    return b"".join(map(CODEC.encode, sent))


def pieces(data: bytes, lengths: list[int]) -> list[bytes]:
    found = list[bytes]()
    for length in lengths:
        found.append(data[:length])
        data = data[length:]
    return [*found, data]


@given(packets, cuts)
def test_frames_are_found_however_a_stream_is_cut(
    sent: list[MavlinkPacket], lengths: list[int]
) -> None:
    reading = Reading()
    found = [p for piece in pieces(frames(sent), lengths) for p in reading.read(piece)]
    assert [p.name for p in found] == [p.name for p in sent]
    for ours, theirs in zip(sent, found, strict=True):
        assert theirs.fields.items() >= ours.fields.items()
        assert theirs[2:] == (1, 1, "udp test")
    assert not reading.counts


@given(packets, cuts)
def test_frames_are_found_in_datagrams_that_are_cut_as_a_serial_cable_was_read(
    sent: list[MavlinkPacket], lengths: list[int]
) -> None:
    """But where the rest of a frame begins as a frame does."""
    cut = pieces(frames(sent), lengths)
    found = Reading().read(*cut, datagrams=True)
    begun = sum(piece[:1] in (b"\xfd", b"\xfe") for piece in cut)
    assert len(sent) - begun <= len(found) <= len(sent)


@given(st.binary(max_size=600), packets)
def test_garbage_in_a_stream_is_counted_and_ends(garbage: bytes, sent: list[MavlinkPacket]) -> None:
    """What looks like the first byte of a frame may swallow the next one, but not more."""
    reading = Reading()
    reading.read(garbage)
    for _ in range(2 * LONGEST // 12):
        reading.read(CODEC.encode(heartbeat()))
    reading.counts.clear()
    found = reading.read(frames(sent))
    assert [p.name for p in found] == [p.name for p in sent]
    assert not reading.counts


@given(st.lists(st.binary(max_size=300), max_size=20), st.booleans())
def test_rubbish_never_raises_and_is_not_kept(chunks: list[bytes], datagrams: bool) -> None:
    cutter, total = FrameCutter(), 0
    for chunk in chunks:
        found, garbage = cutter.frames([chunk], datagrams=datagrams)
        total += len(b"".join(found)) + garbage
    kept = sum(map(len, chunks)) - total
    assert 0 <= kept < LONGEST, "one frame at most"
    Reading().read(*chunks, datagrams=datagrams)


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_frame_with_a_wrong_byte_is_never_another_packet(where: int, wrong: int) -> None:
    """Which its checksum tells."""
    data = bytearray(CODEC.encode(STICKS))
    data[where % len(data)] ^= wrong
    for packet in Reading().read(bytes(data)):
        assert packet.fields == {} or packet.fields.items() >= STICKS.fields.items()


@given(st.lists(st.binary(max_size=60), max_size=5))
def test_after_rubbish_datagrams_the_next_packet_is_heard(rubbish: list[bytes]) -> None:
    [packet] = Reading().read(*rubbish, CODEC.encode(STICKS), datagrams=True)[-1:]
    assert packet.name == "MANUAL_CONTROL"


def test_a_truncated_datagram_is_counted_and_an_unknown_message_has_no_fields() -> None:
    reading, cut = Reading(), CODEC.encode(STICKS)[:-3]
    unknown = bytearray(CODEC.encode(heartbeat()))
    unknown[7:10] = (54_321).to_bytes(3, "little")  # the number of the message
    [packet] = reading.read(cut, bytes(unknown), datagrams=True)
    assert packet.fields == {}
    assert reading.counts == {"malformed:mavlink": 1}


def test_a_flood_leaves_out_no_newest_sticks() -> None:
    """However much else a ground station sends, and however early in it the sticks are."""
    pulses = {f"chan{n}_raw": 1500 for n in range(1, 9)}
    override = MavlinkPacket(
        "RC_CHANNELS_OVERRIDE", {"target_system": 1, "target_component": 1, **pulses}
    )
    early = [STICKS._replace(fields=STICKS.fields | {"x": x}) for x in (1, 2, 3)]
    reading = Reading()
    found = reading.read(frames([*early, override, *[command(1, n) for n in range(1000)]]))
    assert [p.name for p in found[:3]] == ["MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE", "COMMAND_LONG"]
    assert found[0].fields["x"] == 3
    assert len(found) == 2 + MOST
    assert reading.counts == {"overflowed:mavlink": 1002 - MOST}


def test_only_what_is_listened_to_is_decoded_of_the_board_and_everything_of_others() -> None:
    ours, theirs = MavlinkCodec(1, 1), MavlinkCodec(255, 190)
    time = MavlinkPacket("SYSTEM_TIME", {"time_unix_usec": 1, "time_boot_ms": 1})
    sent = [ours.encode(heartbeat()), ours.encode(time), theirs.encode(time)]
    assert [p.name for p in Reading(HeardMessages(1, ["HEARTBEAT"])).read(*sent)] == [
        "HEARTBEAT", "SYSTEM_TIME",
    ]  # fmt: skip
    assert [p.system for p in Reading().read(*sent)] == [1, 1, 255]


def test_nan_and_text_that_is_none_arrive_as_they_are() -> None:
    raw = GROUND.param_set_encode(1, 1, b"\xff\xfe\x00", float("nan"), 9).pack(GROUND)
    [packet] = Reading().read(bytes(raw))
    assert isinstance(packet.fields["param_id"], str)
    assert packet.fields["param_value"] != packet.fields["param_value"]
