"""One topic: its key, message type, rate, QoS profile and direction across the link."""

import re
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Generic, Literal, TypeVar, cast

from messages.message import Message

M = TypeVar("M", bound=Message)

MEMBER = re.compile(r"[a-z0-9_]{1,64}")  # what a member of a family may be called
STALE_PERIODS = 5  # a topic is stale after this many nominal periods without a message
STALE_AT_LEAST_NS = 100_000_000  # [ns] lateness of a busy computer that is no fault


class Qos(Enum):
    """QoS profile of a topic. `services/runtime/bus/zenoh_bus.py` has its settings in Zenoh."""

    REALTIME = "realtime"  # commands: highest priority, newest wins
    LIVE = "live"  # the control chain: useless when old
    EVENT = "event"  # rare, and each one matters: senders repeat until answered
    BULK = "bulk"  # for people and files: lowest priority


Side = Literal["topside", "drone"]  # the two ends of the tether, each with a bus of its own


class Direction(Enum):
    """In which direction a topic crosses the link."""

    DOWN = "down"  # topside to drone
    UP = "up"  # drone to topside
    BOTH = "both"  # published on either side, received on both
    STAY = "stay"  # never leaves the drone


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """A row of the topic table. A key that ends in `/*` is a family; `of("control")` a member."""

    key: str
    message: type[M]
    hz: float  # [1/s] nominal rate; 0 for events
    qos: Qos
    way: Direction
    # On a link that cannot carry all: what is left for telemetry is divided by weight, and no
    # stream gets less than its floor while the picture does not need it. 0: never thinned out.
    weight: float = 0.0
    floor_hz: float = 0.0  # [1/s] 0: it may be left out

    @property
    def encoding(self) -> str:
        """Zenoh encoding: tells a receiver the message type before it decodes the payload."""
        return f"application/msgpack;{self.message.__name__}"

    @property
    def replayed(self) -> str:
        """Encoding of a recorded message that is played again: no port of a live dive takes it."""
        return f"{self.encoding};replayed"

    @property
    def stale_after_ns(self) -> int | None:
        """[ns] Age beyond which a message of this topic is stale; None for events."""
        if self.hz == 0:
            return None
        return max(STALE_AT_LEAST_NS, round(STALE_PERIODS * 1e9 / self.hz))

    @property
    def is_family(self) -> bool:
        return self.key.endswith("/*")

    def of(self, member: str) -> "Topic[M]":
        """One member of a family: `HEALTH.of("control").key == "health/control"`."""
        return replace(self, key=self.key[:-1] + member)

    def covers(self, key: str) -> bool:
        """Is `key` this topic, or a member of this family?"""
        if not self.key.endswith("/*"):
            return key == self.key
        prefix = self.key[:-1]
        return key.startswith(prefix) and MEMBER.fullmatch(key, len(prefix)) is not None


AnyTopic = Topic[Any]


def rows(names: dict[str, Any]) -> tuple[AnyTopic, ...]:
    """All topics among a module's globals, in their order."""
    return tuple(cast(AnyTopic, v) for v in names.values() if isinstance(v, Topic))
