"""The time in a picture survives the codec, and nothing else is taken for it."""

from math import radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.camera.core import Order
from services.camera.sea import CameraView, SimulatedSea, WaterLight
from services.marine import time_stripe
from services.marine.attitude import LEVEL

S = 1_000_000_000
time = st.integers(-(10**18), 10**18)


def blank() -> time_stripe.Luma:
    return np.full((72, 512), 90, np.uint8)


@given(stamp=time, away=st.integers(-(10**15), 10**15))
def test_what_is_written_is_read_to_the_microsecond(stamp: int, away: int) -> None:
    luma = blank()
    time_stripe.write(luma, stamp)
    assert time_stripe.read(luma, stamp + away) == stamp // 1000 * 1000


@given(stamp=time, level=st.integers(0, 255))
def test_it_is_painted_over_and_a_picture_without_one_is_left_as_it_is(
    stamp: int, level: int
) -> None:
    luma = np.full((72, 512), level, np.uint8)
    plain = np.stack([luma, luma, luma], -1)
    time_stripe.write(luma, stamp)
    for seen in (plain.copy(), np.stack([luma, luma, luma], -1)):
        time_stripe.paint_over(seen)
        assert np.array_equal(seen, plain)


@given(stamp=time, block=st.integers(0, 63))
def test_one_wrong_block_is_noticed(stamp: int, block: int) -> None:
    luma = blank()
    time_stripe.write(luma, stamp)
    row, column = divmod(block, time_stripe.COLUMNS)
    at = luma[row * 8 : row * 8 + 8, column * 16 : column * 16 + 16]
    at[:] = 251 - at
    assert time_stripe.read(luma, stamp) is None


@pytest.mark.parametrize("level", [0, 16, 90, 235, 255])
def test_a_picture_without_a_stripe_has_no_time(level: int) -> None:
    assert time_stripe.read(np.full((72, 512), level, np.uint8), 0) is None
    assert time_stripe.read(np.full((10, 20), level, np.uint8), 0) is None


@pytest.mark.parametrize("kbit", [60.0, pytest.param(300.0, marks=pytest.mark.slow)])
def test_it_survives_h264_of_a_low_bitrate(kbit: float) -> None:
    av = pytest.importorskip("av")
    from services.camera.io.encoder import VideoEncoder

    sea = SimulatedSea(640, 360, radians(80.0), WaterLight(), 8.0)
    encoder, decoder = VideoEncoder(640, 360), av.CodecContext.create("h264", "r")
    decoder.thread_count, decoder.options = 1, {"flags": "low_delay"}
    hz = min(25.0, kbit / 6.0)
    size = 0
    for k in range(12):
        stamp = 5 * S + round(k * S / hz) + k * k * 7_777_000
        picture = sea.draw(CameraView((0.1 * k, 0.0, 6.0), LEVEL, -0.3, 0.5))
        time_stripe.write(picture.y, stamp)
        data = encoder.encode(picture, stamp, Order(kbit, hz, k == 0))
        size += len(data)
        (frame,) = decoder.decode(av.Packet(data))
        luma = frame.to_ndarray(format="gray")
        assert luma.shape == (360, 640)
        assert time_stripe.read(luma, 0) == stamp // 1000 * 1000
    assert size * 8e-3 < 1.6 * kbit * 12 / hz  # begun with a keyframe
