"""What was lost in a dive, each message once.

Everybody counts what they miss: a message that the link lost or left out is counted by the tether,
and once more, as a gap, by every service on the far side that listens. Here the gaps are reduced
to what nobody else has a name for, and of several services that missed the same stream the one
that missed most is believed.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping

from messages import topics
from messages.topic import Way
from services.runtime.hosts.registry import Registry

LINK = "tether"
# What the link counts of each message that it does not carry.
NOT_CARRIED = (
    "thinned", "loss", "burst", "trace", "outage", "queue_full", "codel", "too_many",
)  # fmt: skip
# A message that a service had, and did not use, leaves a gap behind it too.
HAD = (
    "overflowed", "expired", "malformed", "wrong_type", "from_future", "wrong_epoch", "reordered",
)  # fmt: skip
# What several services say of one and the same message.
OF_ONE_MESSAGE = ("lost", "duplicated", *(kind for kind in HAD if kind != "overflowed"))


def losses(counts: Mapping[str, Counter[str]]) -> Counter[str]:
    """Count by name, over all services.

    Args:
        counts: what each service counted in all its lives, by service.
    """
    link = counts.get(LINK, Counter[str]())
    said: defaultdict[str, list[int]] = defaultdict(list)
    for service, everything in counts.items():
        for name, count in _own(service, everything, link).items():
            said[name].append(count)
    return Counter(
        {
            name: max(each) if name.partition(":")[0] in OF_ONE_MESSAGE else sum(each)
            for name, each in said.items()
        }
    )


def _own(service: str, counts: Counter[str], link: Mapping[str, int]) -> Counter[str]:
    """What a service counted, without what the link or the service itself has counted already."""
    own = Counter(counts)
    for name in counts:
        kind, _, key = name.partition(":")
        far = service != LINK and _crosses(key, service)
        if kind == "lost":
            own[name] -= sum(counts[f"{had}:{key}"] for had in HAD)
            own[name] -= sum(link.get(f"{why}:{key}", 0) for why in NOT_CARRIED) if far else 0
        elif kind == "malformed" and far:
            own[name] -= link.get(f"damaged:{key}", 0)
    return +own


def _crosses(key: str, service: str) -> bool:
    """Did the messages of this key come over the link to this service?"""
    topic = topics.find(key)
    if topic is None:
        return False
    spec = Registry.read().get(service)
    home = "topside" if spec is None else spec.sides[0]  # whoever looks on does so from the topside
    return topic.way is Way.BOTH or topic.way is (Way.DOWN if home == "drone" else Way.UP)
