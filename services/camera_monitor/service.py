"""Camera monitor service, topside: decodes every picture, reads the time in it, and reports."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from messages import cameras, topics
from messages.units import Ns
from messages.video import AccessUnit, CameraShares, VideoPart
from services.camera_monitor.core import Carried, PictureAccount
from services.marine import time_stripe
from services.marine.field_of_view import CameraViews
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

SAID_NS = 1_000_000_000  # [ns] older, it is not so any more


@dataclass(slots=True)
class Shares:
    """What each camera may send, as the large one said last."""

    newest: CameraShares | None = None
    heard_ns: Ns = 0

    def fresh(self, now: Ns) -> CameraShares | None:
        return self.newest if now < self.heard_ns + SAID_NS else None


class Decoder(Protocol):
    """Of the pictures of one camera."""

    def luma(self, data: bytes, *, keyframe: bool) -> NDArray[np.uint8] | None: ...


def wire(node: Node, stack: Stack) -> None:
    try:
        from services.camera_monitor.io.decoder import VideoDecoder
    except ImportError:
        raise LindyError(
            f"camera_monitor needs PyAV, which is not installed; {how_to_install('camera')}"
        ) from None
    views = stack.section("camera", CameraViews).by_name
    shares = Shares()

    def learn(said: CameraShares, now: Ns) -> None:
        shares.newest, shares.heard_ns = said, now

    if len(views) > 1:
        node.each(topics.CAMERA_SHARES, learn)
    carried = Carried()
    for name in views:
        called = cameras.called(name, several=True) if len(views) > 1 else ""
        account = PictureAccount(node.outbox, carried, called)
        _watch(node, name, account, VideoDecoder(), shares)


def _watch(
    node: Node,
    name: str,
    account: PictureAccount,
    decoder: Decoder,
    shares: Shares,
) -> None:
    """Measure the picture of one camera."""
    video = cameras.video(name)
    age = node.publisher(cameras.age(name))

    def report(now: Ns) -> None:
        said = shares.fresh(now)
        small = said is not None and said.large != name
        roomless = said is not None and said.kbit.get(name) == 0.0
        age.put(account.report(now, small=small, roomless=roomless))

    def hear(part: VideoPart, now: Ns) -> None:
        was_whole = not account.broken
        if (unit := account.take(part, now)) is not None:
            look(unit, now)
        if account.broken and was_whole:
            report(now)  # at once: it asks for a keyframe

    def look(unit: AccessUnit, arrived: Ns) -> None:
        about = unit.about
        luma = decoder.luma(unit.data, keyframe=about.keyframe)
        if luma is None:
            account.failed()
            return
        # A film of another dive shows that dive's time: only the camera that drew it is believed.
        said = time_stripe.read(luma, about.stamp_ns) if about.stripe else None
        stripe = None if said is None else node.local_ns(video, said)
        account.decoded(unit, stripe, arrived, node.now())

    node.each(video, hear)
    node.every(topics.PICTURE_AGE.hz, report)
