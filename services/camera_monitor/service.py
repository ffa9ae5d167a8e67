"""Camera monitor service, topside: how old each picture is when it is whole, and what the link lets
through of it."""

from dataclasses import dataclass

from messages import cameras, topics
from messages.units import Ns
from messages.video import CameraShares, VideoPart
from services.camera_monitor.core import Carried, PictureAccount
from services.marine.field_of_view import CameraViews
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


def wire(node: Node, stack: Stack) -> None:
    views = stack.section("camera", CameraViews).by_name
    shares = Shares()

    def learn(said: CameraShares, now: Ns) -> None:
        shares.newest, shares.heard_ns = said, now

    if len(views) > 1:
        node.each(topics.CAMERA_SHARES, learn)
    carried = Carried()
    for name in views:
        called = cameras.called(name, several=True) if len(views) > 1 else ""
        _watch(node, name, PictureAccount(node.outbox, carried, called), shares)


def _watch(node: Node, name: str, account: PictureAccount, shares: Shares) -> None:
    """Measure the picture of one camera."""
    age = node.publisher(cameras.age(name))

    def report(now: Ns) -> None:
        said = shares.fresh(now)
        small = said is not None and said.large != name
        roomless = said is not None and said.kbit.get(name) == 0.0
        age.put(account.report(now, small=small, roomless=roomless))

    def hear(part: VideoPart, now: Ns) -> None:
        was_whole = not account.broken
        account.take(part, now)
        if account.broken and was_whole:
            report(now)  # at once: it asks for a keyframe

    node.each(cameras.video(name), hear)
    node.every(topics.PICTURE_AGE.hz, report)
