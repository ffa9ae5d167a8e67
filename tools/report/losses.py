"""What was lost in a dive, each message counted once.

A message that the link lost or left out is counted by the tether, and again, as a gap in the
sequence numbers, by every subscriber on the other side. Here the gaps are reduced by the losses
that are already counted elsewhere, and of several services that missed the same topic the largest
count is taken.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping

from messages import topics
from messages.topic import Way
from services.runtime.hosts.registry import Registry

LINK = "tether"
# What the tether counts for a message that it does not deliver.
NOT_CARRIED = (
    "thinned", "loss", "burst", "trace", "outage", "queue_full", "codel", "too_many",
)  # fmt: skip
# A message that a service received but did not use leaves a gap too.
NOT_USED = (
    "overflowed", "expired", "malformed", "wrong_type", "from_future", "wrong_epoch", "reordered",
)  # fmt: skip
# What several services count for the same message.
OF_ONE_MESSAGE = ("lost", "duplicated", *(kind for kind in NOT_USED if kind != "overflowed"))


def losses(counts: Mapping[str, Counter[str]]) -> Counter[str]:
    """Count by name, over all services.

    Args:
        counts: what each service counted, before restarts included, by service.
    """
    link = counts.get(LINK, Counter[str]())
    by_name: defaultdict[str, list[int]] = defaultdict(list)
    for service, everything in counts.items():
        for name, count in _own(service, everything, link).items():
            by_name[name].append(count)
    return Counter(
        {
            name: max(each) if name.partition(":")[0] in OF_ONE_MESSAGE else sum(each)
            for name, each in by_name.items()
        }
    )


def _own(service: str, counts: Counter[str], link: Mapping[str, int]) -> Counter[str]:
    """A service's counts, without those that the link or the service itself has counted already."""
    own = Counter(counts)
    for name in counts:
        kind, _, key = name.partition(":")
        crossed = service != LINK and _crosses(key, service)
        if kind == "lost":
            own[name] -= sum(counts[f"{reason}:{key}"] for reason in NOT_USED)
            if crossed:
                own[name] -= sum(link.get(f"{reason}:{key}", 0) for reason in NOT_CARRIED)
        elif kind == "malformed" and crossed:
            own[name] -= link.get(f"damaged:{key}", 0)
    return +own


def _crosses(key: str, service: str) -> bool:
    """Did the messages of this key come over the link to this service?"""
    topic = topics.find(key)
    if topic is None:
        return False
    spec = Registry.read().get(service)
    home = "topside" if spec is None else spec.sides[0]  # the supervisor is on the topside
    return topic.way is Way.BOTH or topic.way is (Way.DOWN if home == "drone" else Way.UP)
