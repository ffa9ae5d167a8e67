"""Bytes to packets whatever arrives, and the board's clock whatever the delays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ardusub.board_clock import BoardClock
from services.ardusub.framing import LONGEST, FrameCutter
from services.ardusub.io.codec import MOST, BoardCodec, FrameReader
from services.ardusub.packet import MavlinkPacket, command, heartbeat

MS, S = 1_000_000, 1_000_000_000  # [ns]
CODEC = BoardCodec(1, 1)
SOME = [
    heartbeat(),
    command(1, 400, 1.0),
    MavlinkPacket("STATUSTEXT", {"severity": 2, "text": "Leak Detected"}),
    MavlinkPacket("PARAM_VALUE", {"param_id": "FRAME_CONFIG", "param_value": 2.0, "param_type": 9,
                           "param_count": 10, "param_index": 1}),
]  # fmt: skip
packets = st.lists(st.sampled_from(SOME), max_size=6)


@given(packets, st.lists(st.integers(1, 40), max_size=30))
def test_frames_are_found_however_they_are_cut(sent: list[MavlinkPacket], cuts: list[int]) -> None:
    data, reader, found = (
        b"".join(map(CODEC.encode, sent)),
        FrameReader(CODEC),
        list[MavlinkPacket](),
    )
    for length in [*cuts, len(data)]:
        found += reader.read(data[:length]).packets
        data = data[length:]
    assert [p.name for p in found] == [p.name for p in sent]
    for ours, theirs in zip(sent, found, strict=True):
        assert theirs.fields.items() >= ours.fields.items()
        assert (theirs.system, theirs.component) == (1, 1)


@given(st.binary(max_size=600), packets)
def test_garbage_is_counted_and_ends(garbage: bytes, sent: list[MavlinkPacket]) -> None:
    """What looks like the first byte of a frame may swallow the next one, but not more."""
    reader = FrameReader(CODEC)
    reader.read(garbage)
    for _ in range(2 * LONGEST // 12):
        reader.read(CODEC.encode(heartbeat()))
    found = reader.read(b"".join(map(CODEC.encode, sent)))
    assert [p.name for p in found.packets] == [p.name for p in sent]
    assert found.wrong == 0


def test_of_a_flood_the_newest_are_read() -> None:
    data = b"".join(CODEC.encode(command(1, n)) for n in range(1000))
    found = FrameReader(CODEC).read(data)
    assert [p.fields["command"] for p in found.packets] == list(range(1000 - MOST, 1000))
    assert (found.wrong, found.left_out) == (0, 1000 - MOST)


def test_bytes_that_are_no_frame_are_counted_and_never_kept() -> None:
    framing = FrameCutter()
    for _ in range(50):
        frames, garbage = framing.frames(b"\x55" * 1000)
        assert (frames, garbage) == ([], 1000)


def test_a_wrong_check_sum_is_no_packet() -> None:
    data = bytearray(CODEC.encode(heartbeat()))
    data[-1] ^= 0xFF
    assert FrameReader(CODEC).read(bytes(data)) == ([], 1, 0)


def test_an_unknown_message_is_left_alone() -> None:
    data = bytearray(CODEC.encode(heartbeat()))
    data[7:10] = b"\xfe\xff\xff"
    found = FrameReader(CODEC).read(bytes(data))
    assert (found.wrong, found.packets[0].fields) == (0, {})


delays = st.lists(
    st.tuples(st.integers(0, 30 * MS), st.integers(0, 30 * MS)), min_size=1, max_size=40
)


@given(delays, st.integers(-1000 * S, 1000 * S), st.floats(-50e-6, 50e-6))
def test_the_offset_is_within_its_bound(
    trips: list[tuple[int, int]], offset: int, drift: float
) -> None:
    """Whatever the delays of the two ways, and with crystals that differ by up to 50 ppm."""
    clock, now = BoardClock(), 2000 * S
    for down, up in trips:
        board = round((now + down) * (1 + drift)) - offset
        assert clock.answered(now, board, now + down + up)
        now += down + up + 200 * MS
        stamped = round(now * (1 + drift)) - offset
        assert clock.heard(stamped, now + 3 * MS)
        ours = clock.ours(stamped, now + 3 * MS)
        assert ours is not None
        assert abs(ours - now) <= clock.bound_ns + 1
        assert ours <= now + 3 * MS
    assert clock.jumps == 0


def test_nothing_is_known_before_an_answer() -> None:
    clock = BoardClock()
    assert clock.heard(5 * S, 9 * S)
    assert clock.ours(5 * S, 9 * S) is None


@given(st.lists(st.integers(-40 * MS, 40 * MS), max_size=30))
def test_a_clock_that_shifts_a_little_is_followed(shifts: list[int]) -> None:
    clock, now, offset = BoardClock(), 100 * S, 50 * S
    for shift in [0, *shifts]:
        offset += shift
        assert clock.answered(now, now + MS - offset, now + 2 * MS)
        ours = clock.ours(now + MS - offset, now + 2 * MS)
        assert ours is not None
        assert abs(ours - now - MS) <= 1.1 * MS
        now += 200 * MS
    assert clock.jumps == 0


@pytest.mark.parametrize("jump", [-10 * S, -S, -200 * MS, 200 * MS, 10 * S])
def test_a_jump_is_noticed_with_the_next_answer(jump: int) -> None:
    clock, now = BoardClock(), 100 * S
    for _ in range(10):
        assert clock.answered(now, now + MS - 50 * S, now + 2 * MS)
        now += 200 * MS
    assert not clock.answered(now, now + MS - 50 * S + jump, now + 2 * MS)
    assert clock.jumps == 1
    assert clock.ours(now + MS - 50 * S + jump, now + 2 * MS) == pytest.approx(now + MS, abs=2 * MS)


def test_only_what_is_listened_to_is_decoded_of_the_board_and_everything_of_others() -> None:
    ours, theirs = BoardCodec(1, 1), BoardCodec(255, 190)
    attitude = MavlinkPacket("SYSTEM_TIME", {"time_unix_usec": 1, "time_boot_ms": 1})
    frames = [ours.encode(heartbeat()), ours.encode(attitude), theirs.encode(attitude)]
    names = [p.name for p in FrameReader(ours, 1, ["HEARTBEAT"]).read(b"".join(frames)).packets]
    assert names == ["HEARTBEAT", "SYSTEM_TIME"]
    found = FrameReader(ours).read(b"".join(frames))
    assert [p.system for p in found.packets] == [1, 1, 255]
    assert (found.wrong, found.left_out) == (0, 0)
