"""Link profile, a file of deploy/links/: the properties of each direction of a link, with the
distributions that they are drawn from."""

from bisect import bisect_right
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import events
from messages.events import Row
from messages.units import Share

# Delay distributions of the link, each given by its quantile function, and the numbers that they
# are drawn by: in blocks, a tenth of the cost of drawing one by one.


Floats = NDArray[np.float64]
BLOCK = 1024  # numbers drawn at once
LONGEST_MS = 60_000.0  # [ms] longest delay of a message
TAIL = 1e-9  # [-] a distribution ends at this quantile and its opposite: nothing is infinite
Milliseconds = Annotated[float, msgspec.Meta(ge=0.0, le=LONGEST_MS)]


class DelayDistribution(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of the distributions."""

    def quantile(self, share: Floats) -> Floats:
        """[ms] Delay that this share of the messages does not exceed; same shape as `share`."""
        raise NotImplementedError


class Exponential(DelayDistribution, frozen=True, tag="exponential"):
    """What `jitter_ms` of a profile adds."""

    mean_ms: Milliseconds  # [ms]

    def quantile(self, share: Floats) -> Floats:
        return -self.mean_ms * np.log1p(-share)


class Pareto(DelayDistribution, frozen=True, tag="pareto"):
    """Pareto of the second kind (Lomax): from zero, with a tail of rare long delays."""

    mean_ms: Milliseconds  # [ms]
    shape: Annotated[float, msgspec.Meta(gt=1.0, le=100.0)] = 3.0  # [-] smaller: longer tail

    def quantile(self, share: Floats) -> Floats:
        scale = self.mean_ms * (self.shape - 1.0)
        return scale * ((1.0 - share) ** (-1.0 / self.shape) - 1.0)


class Table(DelayDistribution, frozen=True, tag="table"):
    """Quantiles at equal shares, from the least delay to the greatest, and lines between them: two
    of them are a uniform distribution, many are measured delays."""

    ms: Annotated[tuple[Milliseconds, ...], msgspec.Meta(min_length=2, max_length=100_000)]  # [ms]

    def quantile(self, share: Floats) -> Floats:
        ordered = np.sort(np.array(self.ms))
        return np.interp(share, np.linspace(0.0, 1.0, len(ordered)), ordered)


class Trace(DelayDistribution, frozen=True, tag="trace"):
    """A recorded link, replayed in a loop: at every moment the delay or loss it had then."""

    # CSV `sent_s,arrived_s` beside the profile; its rows become the two fields below.
    file: str = ""
    sent_s: tuple[float, ...] = ()  # [s] ascending
    arrived_s: tuple[float | None, ...] = ()  # [s] None: lost

    def __post_init__(self) -> None:
        if len(self.sent_s) != len(self.arrived_s):
            raise ValueError("sent_s and arrived_s must be of the same length")
        if not self.sent_s and not self.file:
            raise ValueError("a trace needs a file")
        for before, after in zip(self.sent_s, self.sent_s[1:], strict=False):
            if not after > before:
                raise ValueError(
                    f"sent_s {after:g} comes after {before:g}, expected ascending times"
                )
        for sent, arrived in zip(self.sent_s, self.arrived_s, strict=True):
            if arrived is not None and not 0.0 <= arrived - sent <= LONGEST_MS / 1e3:
                raise ValueError(
                    f"arrived_s is {arrived:g} for sent_s {sent:g}, expected 0 to 60 s later"
                )

    def at(self, seconds: float) -> float | None:
        """[ms] Delay at a moment [s] since the link began; None: lost."""
        first, length = self.sent_s[0], self.sent_s[-1] - self.sent_s[0]
        place = first + (seconds % length if length > 0.0 else 0.0)
        k = bisect_right(self.sent_s, place) - 1
        arrived = self.arrived_s[k]
        return None if arrived is None else 1e3 * (arrived - self.sent_s[k])


Delay = Pareto | Table | Trace  # kinds of a profile file
Drawn = Exponential | Pareto | Table


class UniformStream:
    """Numbers of [0, 1), one after the other."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._left: list[float] = []

    def next(self) -> float:
        if not self._left:
            self._left = self._random.random(BLOCK).tolist()
        return self._left.pop()

    def happens(self, share: float) -> bool:
        """True with this probability. Costs no draw when it is impossible."""
        return share > 0.0 and self.next() < share


class Delays:
    """Delays drawn one after the other, each independently of the others."""

    def __init__(self, spread: Drawn, random: np.random.Generator) -> None:
        self._spread = spread
        self._random = random
        self._left: list[float] = []

    def next_ms(self) -> float:
        if not self._left:
            share = np.clip(self._random.random(BLOCK), TAIL, 1.0 - TAIL)
            drawn = self._spread.quantile(share)
            self._left = np.minimum(drawn, LONGEST_MS)[::-1].tolist()
        return self._left.pop()


# Loss models and outages: which messages never arrive.


UpToADay = Annotated[float, msgspec.Meta(ge=0.0, le=86_400.0)]
Period = Annotated[float, msgspec.Meta(gt=0.0, le=86_400.0)]


class Loss(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A link with a good and a bad state; it may change before every message. One that never turns
    bad loses each message independently of the others.

    Gilbert 1960, *Capacity of a burst-noise channel*; Elliott 1963, *Estimates of error rates for
    codes on burst-noise channels*.
    """

    to_bad: Share = 0.0  # [-] of the messages in the good state: the link turns bad
    to_good: Share = 1.0  # [-] of the messages in the bad state: the link turns good
    loss_bad: Share = 1.0  # [-] of the messages in the bad state
    loss_good: Share = 0.0  # [-] of the messages in the good state

    def __post_init__(self) -> None:
        if self.to_good == 0.0 and self.to_bad > 0.0:
            raise ValueError("to_good is 0, expected more: the link would stay bad for ever")

    @property
    def mean(self) -> float:
        """[-] Share of all messages that is lost in the long run."""
        both = self.to_bad + self.to_good
        if both == 0.0:
            return self.loss_good
        return (self.to_good * self.loss_good + self.to_bad * self.loss_bad) / both


class Outage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    start_s: UpToADay  # [s] since the link began
    seconds: Period  # [s]

    @property
    def end_s(self) -> float:
        return self.start_s + self.seconds


class Outages(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A schedule of outages. It repeats every `repeat_s`."""

    windows: tuple[Outage, ...] = ()  # ascending
    repeat_s: UpToADay = 0.0  # [s] 0: once only

    def __post_init__(self) -> None:
        for before, after in pairwise(self.windows):
            if after.start_s < before.end_s:
                raise ValueError(
                    f"windows overlap: the outage at {after.start_s:g} s begins before the one at "
                    f"{before.start_s:g} s ends"
                )
        if self.repeat_s and self.windows and self.windows[-1].end_s > self.repeat_s:
            raise ValueError(
                f"repeat_s is {self.repeat_s:g}, expected at least the end of the last outage, "
                f"{self.windows[-1].end_s:g}"
            )

    def touch(self, since_s: float, until_s: float) -> bool:
        """Is there an outage at any moment from `since_s` to `until_s` [s], both included?"""
        if not self.windows:
            return False
        if self.repeat_s == 0.0:
            return any(w.start_s <= until_s and since_s < w.end_s for w in self.windows)
        if until_s - since_s >= self.repeat_s:
            return True
        since = since_s % self.repeat_s
        until = since + (until_s - since_s)
        return any(
            w.start_s + round_s <= until and since < w.end_s + round_s
            for w in self.windows
            for round_s in (0.0, self.repeat_s)
        )


class Losses:
    """Decides message by message. The link begins in its good state."""

    def __init__(self, loss: Loss, random: UniformStream) -> None:
        self._loss = loss
        self._random = random
        self._bad = False

    def reason(self) -> Row | None:
        """Why the next message is lost; None: it is not."""
        loss = self._loss
        if self._random.happens(loss.to_good if self._bad else loss.to_bad):
            self._bad = not self._bad
        if not self._random.happens(loss.loss_bad if self._bad else loss.loss_good):
            return None
        return events.BURST if self._bad else events.LOSS


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
