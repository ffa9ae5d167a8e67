"""Tether service: what goes in at one end comes out at the other, late, byte for byte."""

import numpy as np

from messages import topics
from messages.link import LinkStatus
from messages.topic import Way
from services.runtime.bus import Envelope
from services.runtime.node import Node
from services.runtime.settings import deploy_file, read
from services.runtime.stack import Stack
from services.tether.core import Leg, Line, LinkProfile

TOPSIDE, DRONE = "topside", "drone"
SELF_SAID = (topics.LINK, topics.LINK_ANSWER)  # said by the tether itself, in both realms
DOWN, UP = (Way.DOWN, Way.BOTH), (Way.UP, Way.BOTH)


def wire(node: Node, stack: Stack) -> None:
    profile = read(deploy_file("links", stack.link), LinkProfile)
    down = _carry(node, TOPSIDE, DRONE, DOWN, profile.down, stack.seed)
    up = _carry(node, DRONE, TOPSIDE, UP, profile.up, stack.seed + 1)
    status = node.publisher(topics.LINK)

    def report(now: int) -> None:
        below, above = down.report(), up.report()
        known = below.delay_p50_ms is not None and above.delay_p50_ms is not None
        status.put(
            LinkStatus(
                stamp_ns=now,
                profile=stack.link,
                up=known,
                down_link=below,
                up_link=above,
                rtt_ms=(below.delay_p50_ms or 0.0) + (above.delay_p50_ms or 0.0) if known else None,
            )
        )

    node.every(topics.LINK.hz, report)


def _carry(
    node: Node, source: str, target: str, ways: tuple[Way, ...], leg: Leg, seed: int
) -> Line[Envelope]:
    """Connect one direction of the link and return its line."""
    line: Line[Envelope] = Line(leg, np.random.default_rng(seed))
    release = node.alarm(lambda now: let_out(now))

    def enter(envelope: Envelope, arrived: int) -> None:
        if not line.enter(envelope, arrived):
            node.count(f"dropped:{envelope.key}")
        release.set(line.due())

    def let_out(now: int) -> None:
        while (envelope := line.leave(now)) is not None:
            node.realms[target].forward(envelope)
        release.set(line.due())

    for topic in topics.ALL:
        if topic.way in ways and topic not in SELF_SAID:
            node.tap(source, topic.key, enter)
    return line
