"""Synthetic drones say what real ones do: the same rows, as often, valid, of the usual length."""

from collections import Counter
from pathlib import Path
from statistics import mean

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.payload import PayloadDecoder
from messages.topic import Direction, Side
from services.runtime.bus.spaces import name_in
from tests.support.synthetic import ASKED, TICK_HZ, due, said, said_by
from tools.recordings.recording import open_recording

GOLDEN = Path(__file__).parents[0] / "golden" / "pioneer.mcap"
SIDES: tuple[Side, Side] = ("drone", "topside")


def row_of(key: str) -> str:
    return key.split("/", 3)[3]


@pytest.mark.parametrize("side", SIDES)
def test_every_message_is_valid_and_of_its_own_drone(side: Side) -> None:
    for stream in said_by(side, "rov-1"):
        assert name_in(stream.topic.key) == "rov-1"
        row = topics.find(row_of(stream.topic.key))
        assert row is not None
        message = said(stream, 7, 123_456)
        read = PayloadDecoder(row).read(
            row_of(stream.topic.key), row.encoding, msgspec.msgpack.encode(message)
        )
        assert read == message
        assert (message.seq, message.stamp_ns) == (7, 123_456)
        assert row.hz in (stream.hz, 0)


@given(st.sampled_from(SIDES), st.integers(0, 500), st.integers(0, 10**6))
def test_every_row_speaks_as_often_as_the_table_says(side: Side, phase: int, first: int) -> None:
    streams, ticks = said_by(side, "x"), round(TICK_HZ)
    spoken = Counter(n for tick in range(first, first + ticks) for n in due(streams, tick, phase))
    assert [spoken[n] for n in range(len(streams))] == [stream.hz for stream in streams]


def test_rows_are_as_long_as_those_of_a_real_dive() -> None:
    lengths: dict[str, list[int]] = {}
    for entry in open_recording(GOLDEN):
        payload = msgspec.msgpack.encode(entry.message)
        lengths.setdefault(entry.key, []).append(len(payload))
    compared = 0
    for stream in said_by("drone", "x"):
        known = lengths.get(row_of(stream.topic.key))
        if known is not None and stream.hz > 1.0:  # the others weigh nothing
            ours = len(msgspec.msgpack.encode(stream.example))
            assert 0.65 < ours / mean(known) < 1.5, stream.topic.key
            compared += 1
    assert compared >= 5


def test_what_is_asked_for_goes_that_way() -> None:
    for side, rows in ASKED.items():
        way = Direction.UP if side == "topside" else Direction.DOWN
        assert all(row.way in (way, Direction.BOTH) for row in rows)
