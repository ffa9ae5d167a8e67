"""The age table: from when on what a person is shown counts as old, and when it is not shown."""

from typing import NamedTuple

from messages import topics
from messages.topic import AnyTopic, M, Topic
from messages.units import Ns

GREY_AT_LEAST_NS = 500_000_000  # [ns] a person does not react to less, and a slow link is no fault
GONE_AT_LEAST_NS = 3_000_000_000  # [ns] he has read it, and it is not that any more


class Ages(NamedTuple):
    """Limits of one kind of data: up to `grey_ns` it is fresh."""

    grey_ns: Ns  # older: shown, and said to be old
    gone_ns: Ns  # older: not shown


def ages(topic: AnyTopic) -> Ages:
    """By the rate in the topic table: stale as for a service, gone after twice that.

    Raises:
        TypeError: an event has no age.
    """
    stale_ns = topic.stale_after_ns
    if stale_ns is None:
        raise TypeError(f"{topic.key} has no rate")
    return Ages(max(GREY_AT_LEAST_NS, stale_ns), max(GONE_AT_LEAST_NS, 2 * stale_ns))


STATE, STATUS, REFERENCE = map(ages, (topics.STATE, topics.STATUS, topics.REFERENCE))
BATTERY, LINK, CLOCK = map(ages, (topics.BATTERY, topics.LINK, topics.CLOCK))
LATENCY, THRUSTERS = map(ages, (topics.LATENCY, topics.THRUSTERS))
PICTURE = Ages(1_000_000_000, GONE_AT_LEAST_NS)  # a still picture looks live: 25 are left out


def old(ages: Ages, stamp_ns: Ns, now: Ns) -> bool:
    """Is it to be said that it is old?"""
    return now - stamp_ns > ages.grey_ns


def shown(topic: Topic[M], message: M | None, now: Ns) -> M | None:
    """The message; None once it is gone."""
    gone = message is None or now - message.stamp_ns > ages(topic).gone_ns
    return None if gone else message
