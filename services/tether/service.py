"""Tether service: forwards messages from one side to the other, delayed, byte for byte."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec

from messages import events, topics
from messages.link import LinkAnswer, LinkRequest
from messages.topic import AnyTopic, Direction
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.tether.core import Link
from services.tether.io.profile_file import asked_for, named
from services.tether.link_model import RANK, LinkDirection
from services.tether.profile import Named

TOPSIDE, DRONE = "topside", "drone"
OWN_TOPICS = (topics.LINK, topics.LINK_ANSWER)  # published by the tether itself, on both sides
DOWN, UP = (Direction.DOWN, Direction.BOTH), (Direction.UP, Direction.BOTH)
# [ns] Parts of a picture are useless later, and those of one picture are dropped together. Long
# enough for a keyframe at the least bitrate.
LIFE = dict.fromkeys((topics.VIDEO.key, topics.FURTHER_VIDEO.key), 1_000_000_000)
UNDOES = {"profile": ("profile", "set"), "down": ("down",), "up": ("down",)}  # of earlier changes
JUDGE_HZ = 5.0  # [1/s] how often telemetry rate control checks the upward direction


class LinkCheckpoint(msgspec.Struct, frozen=True):
    """How the link differs from its file, for a restart in mid-dive."""

    asked: list[LinkRequest] = []  # and granted, in their order


def wire(node: Node, stack: Stack) -> None:
    in_force = named(stack.link)
    link: Link[tuple[str, Envelope]] = Link(in_force.name, in_force.profile, stack.seed)
    let_out_below = _carry(node, link.down, TOPSIDE, DRONE, DOWN)
    let_out_above = _carry(node, link.up, DRONE, TOPSIDE, UP, link.admits_up)
    asked = list((node.restore_checkpoint(LinkCheckpoint) or LinkCheckpoint()).asked)

    def answer(request: LinkRequest, now: int) -> LinkAnswer:
        nonlocal in_force
        found = _changed(link, in_force, request, now)
        change, reason = ("", found) if isinstance(found, str) else (found[1], "")
        in_force = in_force if isinstance(found, str) else found[0]
        return LinkAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            kind=request.kind,
            change=change,
            reason=reason,
            cause_ns=request.stamp_ns,
        )

    for request in asked:
        answer(request, node.now())
    if asked:
        node.log("info", f"link: goes on as it was set ({len(asked)} changes)")
    status, clock = node.publisher(topics.LINK), node.latest(topics.CLOCK)

    def tell(request: LinkRequest, answer: LinkAnswer, now: int) -> None:
        if answer.accepted:
            undone = UNDOES.get(request.kind, ())
            asked[:] = [each for each in asked if each.kind not in undone]
            asked.extend([request] if request.kind != "up" else [])
            node.save_checkpoint(LinkCheckpoint(asked))
        level = "info" if answer.accepted else "warning"
        node.log(level, f"link: {answer.change or answer.reason}")
        let_out_below(now)
        let_out_above(now)

    def judge(now: int) -> None:
        if link.judge(now):
            node.log("info", f"link: {link.telemetry}")

    node.answers(topics.LINK_REQUEST, topics.LINK_ANSWER, answer, tell)
    node.every(JUDGE_HZ, judge)
    node.every(topics.LINK.hz, lambda now: status.put(link.status(now, clock.fresh(now))))


def _changed(
    link: Link[Any], in_force: Named, request: LinkRequest, now: int
) -> tuple[Named, str] | str:
    """The profile in force after a request, and what has changed, in words; or why nothing has."""
    if request.kind == "down":
        link.cut(now)
        return in_force, "the link is cut"
    if request.kind == "up":
        link.restore(now)
        return in_force, "the link is restored"
    found = asked_for(request, in_force)
    if not isinstance(found, str):
        link.change(found[0].name, found[0].profile, now)
    return found


def _carry(  # noqa: C901 - its two ends, and what connects them
    node: Node,
    line: LinkDirection[tuple[str, Envelope]],
    source: str,
    target: str,
    ways: tuple[Direction, ...],
    admits: Callable[[str, int, int], bool] | None = None,
) -> Callable[[int], None]:
    """Connect one direction of the link, and tell what was not carried; returns a function that
    publishes what has arrived. `admits` (key, size [B], now [ns]): is it not thinned out?"""

    def entrance(topic: AnyTopic) -> Callable[[Envelope, int], None]:
        rank, life, of_family = RANK[topic.qos], LIFE.get(topic.key), topic.is_family

        def enter(envelope: Envelope, now: int) -> None:
            # Counted by family, because anybody can invent members of one.
            key = topic.key if not of_family or topic.covers(envelope.key) else "unknown"
            size = len(envelope.payload)
            if envelope.attachment is not None:
                size += len(envelope.attachment)
            if admits is None or admits(key, size, now):
                line.enter((key, envelope), now, size, rank, life)
            else:
                node.outbox.tell(events.THINNED(key))
            due = line.due()
            if line.has_lost or (due is not None and due <= now):
                let_out(now)
            else:  # nearly always
                release.set(due)

        return enter

    def let_out(now: int) -> None:
        arrived: list[Envelope] = []
        while (arrival := line.leave(now)) is not None:
            key, envelope = arrival.item
            if arrival.damaged:
                node.outbox.tell(events.DAMAGED(key))
                envelope = replace(envelope, payload=damaged(envelope.payload), message=None)
            arrived.append(envelope)
        for (key, _), reason in line.take_lost():
            node.outbox.tell(reason(key))
        for envelope in arrived:
            node.sides[target].forward(envelope)
        release.set(line.due())

    release = node.alarm(let_out)
    for topic in topics.ALL:
        if topic.way in ways and topic not in OWN_TOPICS:
            node.tap(source, topic.key, entrance(topic))
    return let_out


NEVER_USED = 0xC1  # the one byte that no msgpack value begins with


def damaged(payload: bytes) -> bytes:
    """Every bit of the last byte flipped, and a first byte that no decoder accepts.

    A real link has a checksum on every frame. The bus has none, so a flipped bit inside a number
    would be taken for another number; no service may act on such a message.
    """
    if not payload:
        return bytes([NEVER_USED])
    turned = bytearray(payload)
    turned[-1] ^= 0xFF
    turned[0] = NEVER_USED
    return bytes(turned)
