"""Camera monitor service, topside: decodes every picture, reads the time in it, and reports."""

from messages import topics
from messages.units import Ns
from messages.video import AccessUnit, VideoPart
from services.camera_monitor.core import PictureAccount
from services.marine import time_stripe
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node


def wire(node: Node, _: Stack) -> None:
    try:
        from services.camera_monitor.io.decoder import VideoDecoder
    except ImportError:
        raise LindyError(
            f"camera_monitor needs PyAV, which is not installed; {how_to_install('camera')}"
        ) from None
    account, decoder = PictureAccount(node.outbox), VideoDecoder()
    age = node.publisher(topics.PICTURE_AGE)

    def report(now: Ns) -> None:
        age.put(account.report(now))

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
        said = time_stripe.read(luma, about.stamp_ns)
        stripe = None if said is None else node.local_ns(topics.VIDEO, said)
        account.decoded(unit, stripe, arrived, node.now())

    node.each(topics.VIDEO, hear)
    node.every(topics.PICTURE_AGE.hz, report)
