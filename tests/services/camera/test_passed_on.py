"""A camera's own H.264 goes on as it comes where the link has room for it."""

import shutil
import time

import pytest

pytest.importorskip("av")

import av

from messages.video import PictureAge
from services.camera.capture_time import Light
from services.camera.core import PASSED_AFTER_NS, Camera, Order, Settings
from services.camera.io.feed import Unit, planes
from services.marine import time_stripe
from tests.services.camera.test_foreign_cameras import (
    PICTURES,
    Watched,
    free_port,
    require_whole,
    sent,
    watched,
)

S = 1_000_000_000  # [ns]
CAME = Light(0, exact=False)


def camera_with_room(kbit: float) -> Camera:
    camera = Camera(Settings(most_kbit=kbit, least_kbit=kbit))
    assert camera.budget(0) == kbit
    return camera


def test_it_begins_once_there_has_been_room_for_two_seconds_and_ends_at_once() -> None:
    camera = camera_with_room(1000.0)
    assert not camera.passes(800.0, 25.0, 0)
    assert not camera.passes(800.0, 25.0, 2 * S)
    assert camera.passes(800.0, 25.0, 2 * S + 1)
    assert not camera.passes(850.0, 25.0, 2 * S + 2)  # 1.2 times that is more than there is
    assert not camera.passes(800.0, 30.0, 9 * S)  # more pictures than are wanted


def test_who_needs_a_keyframe_gets_one_of_our_own_and_then_it_begins_anew() -> None:
    camera = camera_with_room(1000.0)
    assert not camera.passes(500.0, 25.0, 0)
    assert camera.passes(500.0, 25.0, 3 * S)
    camera.heard(PictureAge(stamp_ns=3 * S, keyframe_wanted=True), 3 * S)
    assert not camera.passes(500.0, 25.0, 3 * S)
    order = camera.order(3 * S, 3 * S)
    assert isinstance(order, Order)
    assert order.keyframe
    camera.parts(b"unit", order, CAME, 3 * S, 3 * S)
    assert not camera.passes(500.0, 25.0, 4 * S)
    assert camera.passes(500.0, 25.0, 4 * S + PASSED_AFTER_NS + 1)


def test_the_first_picture_that_we_encode_again_is_a_keyframe() -> None:
    camera = camera_with_room(1000.0)
    assert not camera.passes(500.0, 25.0, 0)
    assert camera.passes(500.0, 25.0, 3 * S)
    for number in range(3):
        order = camera.passed(3 * S, keyframe=number == 0)
        assert camera.parts(b"unit", order, CAME, 3 * S, 3 * S)[0].picture == number + 1
    assert not camera.passes(5000.0, 25.0, 4 * S)
    order = camera.order(4 * S, 4 * S)
    assert isinstance(order, Order)
    assert order.keyframe


def take(seen: Watched, units: list[Unit]) -> None:
    while seen.feed.units:
        units.append(seen.feed.units.popleft())


def made(picture: av.VideoFrame) -> int:
    """[ns] When it was made."""
    said = time_stripe.read(planes(picture).y, time.monotonic_ns())
    assert said is not None
    return said


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg program")
def test_units_can_be_decoded_from_the_first_and_pictures_go_on_without_a_keyframe() -> None:
    url, units = f"udp://127.0.0.1:{free_port()}", list[Unit]()
    form = ("-g", "100", "-f", "mpegts", f"{url}?pkt_size=1316")  # a keyframe every four seconds
    with watched(url) as seen, sent(*form):
        seen.until(lambda: seen.feed.kbit < 10_000.0)
        assert 5.0 < seen.feed.hz < 40.0
        seen.feed.passing = True
        seen.until(lambda: take(seen, units) or len(units) >= PICTURES)
        seen.feed.passing = False
        seen.until_pictures(5)
        take(seen, units)
    assert [unit.keyframe for unit in units[:PICTURES]] == [True] + [False] * (PICTURES - 1)
    decoder = av.CodecContext.create("h264", "r")
    frames = [frame for unit in units for frame in decoder.decode(av.Packet(unit.data))]
    frames += decoder.decode(None)
    assert len(frames) == len(units)
    require_whole(seen.shots)
    first = time_stripe.read(seen.shots[0].picture.y, seen.shots[0].arrived_ns)
    assert first is not None
    assert 0 < first - made(frames[-1]) < S
