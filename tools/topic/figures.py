"""How often a stream comes, how old it is, how much of it there is. Pure.

Intervals and delays are those of the newest `KEPT` messages; rates are over the whole time.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

from messages.topic import AnyTopic
from messages.units import Ns

KEPT = 1000
# Pause and age are medians, bytes a mean.
HEADINGS = (
    "messages", "1/s", "table", "pause ms", "longest", "age ms", "p99", "most", "kbit/s", "bytes",
    "largest",
)  # fmt: skip
UNKNOWN = "–"


@dataclass(slots=True)
class HeardStream:
    """Of one key, since its first message."""

    messages: int = 0
    size: int = 0  # [bytes] of all payloads
    largest: int = 0  # [bytes]
    first_ns: Ns = 0
    newest_ns: Ns = 0
    gaps: deque[Ns] = field(default_factory=lambda: deque[Ns](maxlen=KEPT))
    ages: deque[Ns] = field(default_factory=lambda: deque[Ns](maxlen=KEPT))

    def hear(self, size: int, age: Ns | None, now: Ns) -> None:
        """
        Args:
            size: [bytes] of the payload.
            age: [ns] since the sender's stamp; None: its clock is not known here.
        """
        if self.messages:
            self.gaps.append(now - self.newest_ns)
        else:
            self.first_ns = now
        self.messages, self.newest_ns = self.messages + 1, now
        self.size, self.largest = self.size + size, max(self.largest, size)
        if age is not None:
            self.ages.append(age)

    @property
    def hz(self) -> float | None:
        """[1/s] None: fewer than two messages."""
        span = self.newest_ns - self.first_ns
        return (self.messages - 1) * 1e9 / span if span > 0 else None

    def cells(self, topic: AnyTopic) -> tuple[str, ...]:
        """As `HEADINGS` has them."""
        table = f"{topic.hz:g}" if topic.hz else "events"
        mean = self.size / self.messages if self.messages else None
        kbits = None if self.hz is None or mean is None else self.hz * mean * 8e-3
        largest = float(self.largest) if self.messages else None
        return (
            *(str(self.messages), _number(self.hz), table),
            *_spread(self.gaps, 0.5, 1.0),
            *_spread(self.ages, 0.5, 0.99, 1.0),
            *(_number(kbits), _number(mean, 0), _number(largest, 0)),
        )


def _spread(values: Sequence[Ns], *shares: float) -> tuple[str, ...]:
    """[ms] The least, the most and what is in between; the median is that of two in the middle."""
    if not values:
        return (UNKNOWN,) * len(shares)
    ranked = sorted(values)
    found = [
        median(ranked) if share == 0.5 else ranked[min(len(ranked) - 1, int(share * len(ranked)))]
        for share in shares
    ]
    return tuple(f"{value / 1e6:.1f}" for value in found)


def _number(value: float | None, digits: int = 1) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
