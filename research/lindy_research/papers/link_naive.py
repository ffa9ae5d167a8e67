"""A naive peer over the same model of the link: it acts on whatever arrives, however old."""

import sys
from collections import deque
from typing import TypeVar

import msgspec
import numpy as np

from lindy.api.dives import Stack
from lindy.api.laws import Settings
from lindy.api.links import named
from lindy.api.references import Ramp
from lindy_research.papers.link_flights import SEED, Followed, LinkRun, newest_seen
from services.tether.link_model import LinkDirection
from services.tether.profile import DirectionProfile, Queue

T = TypeVar("T")
WITHOUT_END = Queue(limit_bytes=100_000_000)


def followed(flight: LinkRun, link: str) -> Followed:
    """The sticks and the telemetry of a flight over the same link.

    A peer without time to live: it acts on every command when it arrives, in that order, however
    old, and holds the last one while nothing comes. Everything waits in one queue without end. It
    is spared damaged messages, and its reference is Lindy's own, at the same instants, so
    only what it does with messages differs.
    """
    profile = named(link).profile
    heave = Stack().section("reference", Settings).heave
    begin, commands, t = flight.begin, flight.commands, flight.followed.t
    sent = [(c.stamp_ns, len(msgspec.msgpack.encode(c)), c) for c in commands]
    arriving = deque(_carried(profile.down, sent))
    ramp, acting = Ramp(heave.limits), commands[0]
    rows: list[tuple[float, float]] = []
    for instant in t.tolist():
        now = begin + round(instant * 1e9)
        while arriving and arriving[0][0] <= now:
            acting = arriving.popleft()[1]
            ramp.aim(acting.heave * heave.max_velocity, instant)
        rows.append((ramp.at(instant).position, (now - acting.stamp_ns) / 1e9))
    back = _carried(profile.up, [(said.at, said.size, said) for said in flight.telemetry])
    states = [(now, said.at) for now, said in back if said.is_state]
    depth, age = np.array(rows).T
    return Followed(t, depth, age, newest_seen(states, begin, t))


def _carried(leg: DirectionProfile, sent: list[tuple[int, int, T]]) -> list[tuple[int, T]]:
    """When [ns] each message comes out of one direction of the link, in that order; whatever does
    not fit waits.

    Args:
        sent: when [ns] each enters, its size [B], and itself.
    """
    if leg.rate_kbit > 0.0:
        leg = msgspec.structs.replace(leg, queue=WITHOUT_END)
    line: LinkDirection[T] = LinkDirection(leg, np.random.default_rng(SEED), most=sys.maxsize)
    out: list[tuple[int, T]] = []

    def let_out(until: int) -> None:
        while (due := line.due()) is not None and due <= until:
            while (arrival := line.leave(due)) is not None:
                if not arrival.damaged:
                    out.append((due, arrival.item))

    for now, size, item in sent:
        let_out(now)
        line.enter(item, now, size)
    let_out(sys.maxsize)
    return out
