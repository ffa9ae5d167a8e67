"""Link profile, a file of deploy/links/: the properties of each direction of a link."""

from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec

from messages.units import Share
from services.tether.delay import Delay, Milliseconds
from services.tether.loss import Loss, Outages

Kilobits = Annotated[float, msgspec.Meta(ge=0.0, le=1e7)]
NO_LOSS = Loss()
NO_OUTAGES = Outages()


class Queue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The queue of a link of limited rate. When it is full, less urgent messages are dropped."""

    limit_bytes: Annotated[int, msgspec.Meta(ge=1, le=100_000_000)] = 64_000  # [B] with overhead
    policy: Literal["drop_tail", "drop_oldest"] = "drop_tail"


class Late(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Some messages take longer, and later ones overtake them."""

    share: Share  # [-]
    ms: Milliseconds  # [ms] longer


class DirectionProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One direction of the link."""

    delay_ms: Milliseconds = 0.0  # [ms] shortest one-way delay
    jitter_ms: Milliseconds = 0.0  # [ms] mean of an exponential delay added to delay_ms
    delay: Delay | None = None  # distribution of the delay added to delay_ms, not with jitter_ms
    loss: Loss = NO_LOSS
    late: Late | None = None  # the only cause for messages of one QoS profile to change order
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
            raise ValueError("expected jitter_ms or delay, not both")


class LinkProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file of deploy/links/."""

    about: str = ""
    thin: bool = True  # thin out telemetry upwards when the link cannot carry all of it
    down: DirectionProfile = DirectionProfile()  # topside to drone
    up: DirectionProfile = DirectionProfile()  # drone to topside


class Named(NamedTuple):
    """A profile and the file it was read from."""

    name: str
    tree: dict[str, Any]  # as in the file, to change single keys
    path: Path
    profile: LinkProfile
