"""Tether service: forwards messages from one side to the other, delayed, byte for byte."""

from collections.abc import Callable

from messages import topics
from messages.link import LinkAnswer, LinkRequest
from messages.topic import AnyTopic, Way
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.tether.change import Changer
from services.tether.core import Link
from services.tether.crossing import Crossing
from services.tether.damage import damaged
from services.tether.io.profile_file import asked_for, named
from services.tether.priority_queue import RANK

TOPSIDE, DRONE = "topside", "drone"
OWN_TOPICS = (topics.LINK, topics.LINK_ANSWER)  # published by the tether itself, on both sides
DOWN, UP = (Way.DOWN, Way.BOTH), (Way.UP, Way.BOTH)
# [ns] Parts of a picture are useless later, and those of one picture are dropped together. Long
# enough for a keyframe at the least bitrate.
LIFE = {topics.VIDEO.key: 1_000_000_000}
JUDGE_HZ = 5.0  # [1/s] how often telemetry rate control checks the upward direction


def wire(node: Node, stack: Stack) -> None:
    in_force = named(stack.link)
    link: Link[tuple[str, Envelope]] = Link(in_force.name, in_force.profile, stack.seed)
    let_out_below = _carry(node, Crossing(link.down), TOPSIDE, DRONE, DOWN)
    let_out_above = _carry(node, Crossing(link.up, link.admits_up), DRONE, TOPSIDE, UP)
    changer = Changer(link, in_force, asked_for)
    status, clock = node.publisher(topics.LINK), node.latest(topics.CLOCK)

    def tell(_: LinkRequest, answer: LinkAnswer, now: int) -> None:
        level = "info" if answer.accepted else "warning"
        node.log(level, f"link: {answer.change or answer.reason}")
        let_out_below(now)
        let_out_above(now)

    def judge(now: int) -> None:
        if link.judge(now):
            node.log("info", f"link: {link.telemetry}")

    node.answers(topics.LINK_REQUEST, topics.LINK_ANSWER, changer.answer, tell)
    node.every(JUDGE_HZ, judge)
    node.every(topics.LINK.hz, lambda now: status.put(link.status(now, clock.fresh(now))))


def _carry(
    node: Node,
    crossing: Crossing[Envelope],
    source: str,
    target: str,
    ways: tuple[Way, ...],
) -> Callable[[int], None]:
    """Connect one direction of the link; returns a function that publishes what has arrived."""

    def entrance(topic: AnyTopic) -> Callable[[Envelope, int], None]:
        rank, life = RANK[topic.qos], LIFE.get(topic.key)

        def enter(envelope: Envelope, arrived: int) -> None:
            size = len(envelope.payload) + len(envelope.attachment or b"")
            crossing.enter(_stream(envelope.key), envelope, size, rank, arrived, life)
            let_out(arrived)

        return enter

    def let_out(now: int) -> None:
        for envelope, is_damaged in crossing.leave(now):
            payload = damaged(envelope.payload) if is_damaged else envelope.payload
            node.sides[target].forward(envelope._replace(payload=payload))
        for name in crossing.counts:
            node.count(name)
        crossing.counts.clear()
        release.set(crossing.due())

    release = node.alarm(let_out)
    for topic in topics.ALL:
        if topic.way in ways and topic not in OWN_TOPICS:
            node.tap(source, topic.key, entrance(topic))
    return let_out


def _stream(key: str) -> str:
    """The key that a message is counted under: anybody can invent members of a family."""
    topic = topics.find(key)
    return "unknown" if topic is None else topic.key
