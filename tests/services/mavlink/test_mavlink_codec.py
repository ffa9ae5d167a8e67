"""Frames, and what is none: counted, and nothing else happens."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import (  # pyright: ignore[reportMissingTypeStubs]
    ardupilotmega as dialect,
)

from services.mavlink.io.codec import Codec
from services.mavlink.packets import MavPacket

STICKS = MavPacket("MANUAL_CONTROL", {"target": 1, "x": 1, "y": 2, "z": 500, "r": 3, "buttons": 4})
GROUND = dialect.MAVLink(None, srcSystem=255, srcComponent=190)


def codec() -> Codec:
    return Codec("udp test", 1, Counter())


def frame() -> bytes:
    made = Codec("", 255, Counter()).encode(STICKS)
    assert made is not None
    return made


@given(st.lists(st.integers(1, 30), max_size=40))
def test_a_stream_may_be_cut_anywhere(lengths: list[int]) -> None:
    data, ours, found = frame() * 10, codec(), 0
    for length in lengths:
        found += len(ours.decode(data[:length], whole=False))
        data = data[length:]
    assert found + len(ours.decode(data, whole=False)) == 10


@given(st.lists(st.binary(max_size=300), max_size=20), st.booleans())
def test_rubbish_never_raises_and_is_not_kept(chunks: list[bytes], whole: bool) -> None:
    counts = Counter[str]()
    ours = Codec("udp test", 1, counts)
    for chunk in chunks:
        ours.decode(chunk, whole=whole)
        assert len(ours._mav.buf) <= 300  # pyright: ignore[reportPrivateUsage] - one frame at most


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_frame_with_a_wrong_byte_is_never_another_packet(where: int, wrong: int) -> None:
    data = bytearray(frame())
    data[where % len(data)] ^= wrong
    for packet in codec().decode(bytes(data), whole=True):
        assert dict(packet.fields) == dict(STICKS.fields) | {
            name: packet.fields[name] for name in set(packet.fields) - set(STICKS.fields)
        }


@given(st.binary(max_size=60))
def test_after_rubbish_datagrams_the_next_packet_is_heard(rubbish: bytes) -> None:
    ours = codec()
    ours.decode(rubbish, whole=True)
    (packet,) = ours.decode(frame(), whole=True)
    assert (packet.name, packet.sender.system, packet.sender.link) == (
        "MANUAL_CONTROL", 255, "udp test",
    )  # fmt: skip


def test_a_truncated_datagram_and_an_unknown_message_are_counted() -> None:
    counts = Counter[str]()
    ours = Codec("udp test", 1, counts)
    assert ours.decode(frame()[:-3], whole=True) == []
    unknown = bytearray(frame())
    unknown[7:10] = (54_321).to_bytes(3, "little")  # the number of the message
    assert ours.decode(bytes(unknown), whole=True) == []
    assert counts == {"malformed:mavlink": 2}


def test_nan_and_text_that_is_none_arrive_as_they_are() -> None:
    ours = codec()
    raw = GROUND.param_set_encode(1, 1, b"\xff\xfe\x00", float("nan"), 9).pack(GROUND)
    (packet,) = ours.decode(bytes(raw), whole=True)
    assert isinstance(packet.fields["param_id"], str)
    assert packet.fields["param_value"] != packet.fields["param_value"]


def test_frames_are_numbered() -> None:
    ours = codec()
    numbers = [ours.encode(STICKS) for _ in range(300)]
    assert [n[4] for n in numbers if n is not None] == [k % 256 for k in range(300)]


def test_a_number_that_does_not_fit_is_counted_and_not_sent() -> None:
    counts = Counter[str]()
    ours = Codec("udp test", 1, counts)
    assert ours.encode(MavPacket("MANUAL_CONTROL", dict(STICKS.fields) | {"x": 10**9})) is None
    assert counts == {"does_not_fit:MANUAL_CONTROL": 1}
