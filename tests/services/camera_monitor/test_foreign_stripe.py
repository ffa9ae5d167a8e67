"""A time stripe is believed of the camera that drew it, and of no film of another dive."""

import msgspec
import numpy as np
import pytest

pytest.importorskip("av")

from messages import topics
from messages.video import PictureAge, VideoPart
from services.camera.core import Order
from services.camera.io.encoder import VideoEncoder
from services.camera.sea import Picture
from services.marine import time_stripe
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost

MS, S = 1_000_000, 1_000_000_000
SIZE = WIDTH, HEIGHT = 640, 360
LIGHT = 100 * MS


def report(stripe_ns: int, *, drawn: bool) -> PictureAge:
    """Of one picture whose light arrived at LIGHT, and which shows `stripe_ns`."""
    host = VirtualHost()
    services = Registry.read("camera")
    host.add_all(services.only({"camera_monitor": services["camera_monitor"]}), Stack(virtual=True))
    luma = np.full((HEIGHT, WIDTH), 90, np.uint8)
    time_stripe.write(luma, stripe_ns)
    chroma = np.full((HEIGHT // 2, WIDTH // 2), 128, np.uint8)
    data = VideoEncoder(*SIZE).encode(Picture(luma, chroma, chroma), 0, Order(500.0, 25.0, True))
    part = VideoPart(
        seq=1, stamp_ns=LIGHT, picture=1, keyframe=True, width=WIDTH, height=HEIGHT, stripe=drawn,
        captured_ns=LIGHT, encoded_ns=LIGHT, budget_kbit=500.0, data=data,
    )  # fmt: skip
    found = list[PictureAge]()
    decode = msgspec.msgpack.Decoder(PictureAge).decode
    topside = host.side("topside")
    topside.hear(topics.PICTURE_AGE.key, lambda heard: found.append(decode(heard.payload)))
    host.run(LIGHT + 20 * MS)
    topside.say(topics.VIDEO)(msgspec.msgpack.encode(part))
    host.run(S)
    (seen,) = [age for age in found if age.total is not None]
    return seen


def test_the_stripe_of_a_film_is_part_of_its_picture() -> None:
    age = report(3600 * S, drawn=False)
    assert age.picture_ns == LIGHT
    assert not age.checked
    assert not age.exact


def test_the_stripe_of_the_simulated_camera_is_believed() -> None:
    """A decoder that holds pictures back would show an old one with a new stamp."""
    age = report(60 * MS, drawn=True)
    assert age.picture_ns == 60 * MS
    assert age.exact
    assert report(LIGHT, drawn=True).checked
