"""A file of deploy/links/: what one link is like, each direction by itself."""

from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec

from messages.units import Share
from services.tether.codel import CoDel
from services.tether.delay import Delay, Milliseconds
from services.tether.loss import Loss
from services.tether.outage import Outages

Kilobits = Annotated[float, msgspec.Meta(ge=0.0, le=1e7)]
Bytes = Annotated[int, msgspec.Meta(ge=0, le=100_000_000)]
NO_OUTAGES = Outages()


class Queue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What waits for a link of limited rate. A full queue gives way to what is more urgent."""

    limit_bytes: Annotated[int, msgspec.Meta(ge=1, le=100_000_000)] = 64_000  # [B] with overhead
    policy: Literal["drop_tail", "drop_oldest", "codel"] = "drop_tail"
    codel: CoDel = CoDel()  # of policy codel


class Late(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Some messages take longer, and those behind pass them."""

    share: Share  # [-]
    ms: Milliseconds  # [ms] longer


class DirectionProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One direction of the link."""

    delay_ms: Milliseconds = 0.0  # [ms] shortest one-way delay
    jitter_ms: Milliseconds = 0.0  # [ms] mean of an exponential part on top of it
    delay: Delay | None = None  # what comes on top of delay_ms, instead of jitter_ms
    loss: Loss | None = None
    late: Late | None = None  # the only way in which messages of one stance change places
    duplicate: Share = 0.0  # [-] of the messages arrive twice
    corrupt: Share = 0.0  # [-] of the messages arrive damaged
    rate_kbit: Kilobits = 0.0  # [kbit/s] 0: no limit
    overhead_bytes: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 0  # [B] headers of a message
    queue: Queue | None = None  # of a limited rate; None: the standard one
    outages: Outages = NO_OUTAGES

    def __post_init__(self) -> None:
        if self.queue is not None and self.rate_kbit == 0.0:
            raise ValueError("a queue needs rate_kbit above 0; without a limit nothing waits")
        if self.delay is not None and self.jitter_ms > 0.0:
            raise ValueError("say jitter_ms or delay, not both")


class LinkProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file of deploy/links/."""

    about: str = ""
    thin: bool = True  # thin out telemetry upwards when the link cannot carry all of it
    down: DirectionProfile = DirectionProfile()  # topside to drone
    up: DirectionProfile = DirectionProfile()  # drone to topside


class Named(NamedTuple):
    """A profile and where it is from."""

    name: str
    tree: dict[str, Any]  # as in the file, for those who change single keys
    path: Path
    profile: LinkProfile
