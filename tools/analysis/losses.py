"""What was lost in a dive, each message counted once.

A message that the link lost or left out is counted by the tether, and again, as a gap in the
sequence numbers, by every subscriber on the other side. Here the gaps are reduced by the losses
that are already counted elsewhere, and of several services that missed the same topic the largest
count is taken.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping

from messages import events, topics
from messages.events import Row
from messages.topic import Direction
from messages.units import MOST_COUNTED
from tools.health_sums import HealthSums

LINK = "tether"
# What the tether counts for a message that it does not deliver: lost, left out, without room.
LOST = (events.LOSS, events.BURST, events.TRACE, events.OUTAGE)
THINNED = (events.THINNED,)
QUEUES = (events.QUEUE_FULL, events.TOO_MANY)
NOT_CARRIED = (*LOST, *THINNED, *QUEUES)
# A message that a service received but did not use leaves a gap too.
NOT_USED = (
    events.OVERFLOWED, events.EXPIRED, events.MALFORMED, events.WRONG_TYPE, events.FROM_FUTURE,
    events.WRONG_EPOCH, events.REORDERED,
)  # fmt: skip
# What several services count for the same message.
OF_ONE_MESSAGE = {row.name for row in (events.LOST, events.DUPLICATED, *NOT_USED)} - {
    events.OVERFLOWED.name
}
# Heard at the far end only, by a service whose home is where it is sent.
ANSWERED = topics.CLOCK_PING.key


def losses(
    health: Mapping[str, HealthSums], besides: Mapping[str, Mapping[str, int]] | None = None
) -> Counter[str]:
    """Count by name, over all services and their restarts.

    Args:
        health: of each service.
        besides: what services counted that is not in their health, by service; what is in both is
            counted once.
    """
    counts = {service: sums.counts for service, sums in health.items()}
    for service, more in (besides or {}).items():
        counts[service] = counts.get(service, Counter[str]()) | Counter(more)
    link = counts.get(LINK, Counter[str]())
    by_name: defaultdict[str, list[int]] = defaultdict(list)
    for service, own in counts.items():
        side = health[service].side if service in health else ""
        carried = own if service == LINK else _without_the_links(own, side, link)
        for name, count in carried.items():
            by_name[name].append(count)
    return Counter(
        {
            name: max(each)
            if name.partition(":")[0] in OF_ONE_MESSAGE
            else min(MOST_COUNTED, sum(each))
            for name, each in by_name.items()
        }
    )


def _without_the_links(own: Counter[str], side: str, link: Mapping[str, int]) -> Counter[str]:
    """A service's counts, without those that the link or the service itself has counted already."""
    left, spent = Counter(own), Counter[str]()
    for name in sorted(own):
        kind, _, key = name.partition(":")
        over = crosses(key, side)
        if kind == events.LOST.name and key:
            left[name] = missed(own, key)
            if over:
                left[name] = take(left[name], _of_the_link(link, key, NOT_CARRIED), spent)[1]
        elif kind == events.MALFORMED.name and over:
            left[name] = take(left[name], _of_the_link(link, key, [events.DAMAGED]), spent)[1]
    return +left


def crosses(key: str, side: str) -> bool:
    """May messages of this key have come over the link to this side?"""
    topic = topics.find(key)
    if topic is None:
        return False
    return (
        topic.way in (Direction.BOTH, Direction.DOWN if side == "drone" else Direction.UP)
        or key == ANSWERED
    )


def missed(counts: Mapping[str, int], key: str) -> int:
    """Messages that never came to a service. One that it received but did not use leaves a gap in
    the numbers as well."""
    unused = sum(counts.get(reason(key).name, 0) for reason in NOT_USED)
    return max(0, counts.get(events.LOST(key).name, 0) - unused)


def take(left: int, counts: Mapping[str, int], spent: Counter[str]) -> tuple[int, int]:
    """(taken, left): from each count as much as is left of it, and not more than is missing."""
    taken = 0
    for name, count in counts.items():
        part = max(0, min(left - taken, count - spent[name]))
        spent[name] += part
        taken += part
    return taken, left - taken


def family(key: str) -> str:
    """The name under which the link counts a key: that of its row in the topic table."""
    topic = topics.find(key)
    return key if topic is None else topic.key


def _of_the_link(link: Mapping[str, int], key: str, reasons: Iterable[Row]) -> dict[str, int]:
    names = [reason(family(key)).name for reason in reasons]
    return {name: link.get(name, 0) for name in names}
