"""The recent past of the horizontal filter, so that a late sample is used where it belongs.

The trail is a row of stones, each with the belief after all samples of its time. A sample from
between two stones gets a stone of its own: the leg between them is split there. From that stone on
everything is done once more (Bar-Shalom, Li and Kirubarajan 2001, section 6.5.1 calls such samples
out of sequence; to filter anew is the exact answer).
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from messages.units import Quaternion
from services.estimation.horizontal.horizontal_filter import HorizontalEstimate, Interval
from services.marine.attitude import normalised

SAME_NS = 1_000_000  # [ns] a sample as near as this to a stone belongs there

Correction = Callable[
    [HorizontalEstimate, Interval], HorizontalEstimate
]  # how an accepted sample changes a belief
Propagation = Callable[[HorizontalEstimate, Interval], HorizontalEstimate]


@dataclass(slots=True)
class BufferNode:
    stamp_ns: int
    interval: Interval  # that led here
    estimate: HorizontalEstimate
    readings: list[Correction] = field(default_factory=list[Correction])


class MeasurementBuffer:
    def __init__(self, step: Propagation, seconds: float) -> None:
        """How a belief moves along a leg, and how much [s] of the past to keep."""
        self._step = step
        self._kept_ns = round(seconds * 1e9)
        self._nodes: deque[BufferNode] = deque()

    @property
    def last(self) -> BufferNode:
        return self._nodes[-1]

    def begin(self, stamp_ns: int, interval: Interval, estimate: HorizontalEstimate) -> None:
        """Forget everything and start here."""
        self._nodes = deque([BufferNode(stamp_ns, interval, estimate)])

    def extend(self, stamp_ns: int, interval: Interval) -> None:
        """One leg further."""
        self._nodes.append(BufferNode(stamp_ns, interval, self._step(self.last.estimate, interval)))
        while len(self._nodes) > 2 and stamp_ns - self._nodes[1].stamp_ns >= self._kept_ns:
            self._nodes.popleft()

    def node_at(self, stamp_ns: int) -> BufferNode | None:
        """The stone of this time [ns], put there if need be; None: before the trail begins. What is
        newer than the last stone belongs there."""
        nodes = self._nodes
        if stamp_ns < nodes[0].stamp_ns - SAME_NS:
            return None
        after = len(nodes) - 1
        while after > 0 and nodes[after - 1].stamp_ns >= stamp_ns - SAME_NS:
            after -= 1
        node = nodes[after]
        if node.stamp_ns - stamp_ns <= SAME_NS:
            return node
        return self._split(after, stamp_ns)

    def read(self, node: BufferNode, reading: Correction) -> None:
        """Let an accepted sample of the stone's time change what is believed from there on."""
        node.readings.append(reading)
        node.estimate = reading(node.estimate, node.interval)
        estimate, redo = node.estimate, False
        for each in self._nodes:
            if redo:
                estimate = self._step(estimate, each.interval)
                for old in each.readings:
                    estimate = old(estimate, each.interval)
                each.estimate = estimate
            redo = redo or each is node

    def _split(self, after: int, stamp_ns: int) -> BufferNode:
        before, late = self._nodes[after - 1], self._nodes[after]
        share = (stamp_ns - before.stamp_ns) / (late.stamp_ns - before.stamp_ns)
        interval = late.interval
        attitude = between(before.interval.attitude, interval.attitude, share)
        first = interval._replace(seconds=share * interval.seconds, attitude=attitude)
        node = BufferNode(stamp_ns, first, self._step(before.estimate, first))
        late.interval = interval._replace(seconds=(1.0 - share) * interval.seconds)
        self._nodes.insert(after, node)
        return node


def between(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    """The attitude at this share [-] of the way from a to b, which are not far apart."""
    sign = 1.0 if sum(p * q for p, q in zip(a, b, strict=True)) >= 0.0 else -1.0
    w, x, y, z = (p + share * (sign * q - p) for p, q in zip(a, b, strict=True))
    return normalised((w, x, y, z))
