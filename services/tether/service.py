"""Tether service: what goes in at one end comes out at the other, late, byte for byte."""

from collections.abc import Callable

from messages import topics
from messages.link import LinkAnswer, LinkRequest
from messages.topic import AnyTopic, Way
from services.runtime.bus import Envelope
from services.runtime.node import Node
from services.runtime.stack import Stack
from services.tether.change import Changer
from services.tether.core import Link
from services.tether.damage import damaged
from services.tether.link_model import Line
from services.tether.profile_file import asked_for, named
from services.tether.waiting import RANK

TOPSIDE, DRONE = "topside", "drone"
SELF_SAID = (topics.LINK, topics.LINK_ANSWER)  # said by the tether itself, in both realms
DOWN, UP = (Way.DOWN, Way.BOTH), (Way.UP, Way.BOTH)
JUDGE_HZ = 5.0  # [1/s] how often the way up is looked at


def wire(node: Node, stack: Stack) -> None:
    in_force = named(stack.link)
    link: Link[Envelope] = Link(in_force.name, in_force.profile, stack.seed)
    let_out_below = _carry(node, link.down, TOPSIDE, DRONE, DOWN, _everything)
    let_out_above = _carry(node, link.up, DRONE, TOPSIDE, UP, link.admits_up)
    changer = Changer(link, in_force, asked_for)
    status, clock = node.publisher(topics.LINK), node.latest(topics.CLOCK)

    def tell(_: LinkRequest, answer: LinkAnswer, now: int) -> None:
        level = "info" if answer.accepted else "warning"
        node.log(level, f"link: {answer.change or answer.reason}")
        let_out_below(now)
        let_out_above(now)

    def judge(now: int) -> None:
        if link.judge(now):
            rates = ", ".join(f"{key} {hz:g}/s" for key, hz in link.thinned.items())
            node.log(
                "info",
                f"link: telemetry thinned out to {rates}" if rates else "link: full telemetry",
            )

    node.answers(topics.LINK_REQUEST, topics.LINK_ANSWER, changer.answer, tell)
    node.every(JUDGE_HZ, judge)
    node.every(topics.LINK.hz, lambda now: status.put(link.status(now, clock.fresh(now))))


def _everything(_key: str, _size: int, _now: int) -> bool:
    """Nothing is thinned out on the way down."""
    return True


def _carry(
    node: Node,
    line: Line[Envelope],
    source: str,
    target: str,
    ways: tuple[Way, ...],
    admits: Callable[[str, int, int], bool],
) -> Callable[[int], None]:
    """Connect one direction of the link; returns what lets out whatever has arrived."""
    release = node.alarm(lambda now: let_out(now))

    def entrance(topic: AnyTopic) -> Callable[[Envelope, int], None]:
        rank = RANK[topic.qos]

        def enter(envelope: Envelope, arrived: int) -> None:
            size = len(envelope.payload) + len(envelope.attachment or b"")
            if not admits(envelope.key, size, arrived):
                node.count(f"thinned:{envelope.key}")
                return
            line.enter(envelope, arrived, size, rank)
            let_out(arrived)

        return enter

    def let_out(now: int) -> None:
        while (arrival := line.leave(now)) is not None:
            envelope = arrival.item
            if arrival.damaged:
                node.count(f"damaged:{envelope.key}")
                envelope = envelope._replace(payload=damaged(envelope.payload))
            node.realms[target].forward(envelope)
        for envelope, reason in line.take_lost():
            node.count(f"{reason}:{envelope.key}")
        release.set(line.due())

    for topic in topics.ALL:
        if topic.way in ways and topic not in SELF_SAID:
            node.tap(source, topic.key, entrance(topic))
    return let_out
