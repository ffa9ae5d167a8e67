"""The recent past of the horizontal filter, so that a late sample is used at its own time.

The buffer is a sequence of nodes, each with the estimate after all measurements of its time. A
sample between two nodes gets a node of its own, which splits the interval. From that node on, the
filter is run again (out-of-sequence measurements, Bar-Shalom, Li and Kirubarajan 2001, section
6.5.1; running the filter again is the exact solution).
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from messages.units import Quaternion
from services.estimation.horizontal.horizontal_filter import HorizontalEstimate, Interval
from services.marine.attitude import normalised
from services.marine.summation import plain_sum

SAME_NS = 1_000_000  # [ns] a sample this close to a node uses that node

# Measurement update by an accepted sample, and time update over an interval.
Correction = Callable[[HorizontalEstimate, Interval], HorizontalEstimate]
Propagation = Callable[[HorizontalEstimate, Interval], HorizontalEstimate]


@dataclass(slots=True)
class BufferNode:
    stamp_ns: int
    interval: Interval  # that ends here
    estimate: HorizontalEstimate
    corrections: list[Correction] = field(default_factory=list[Correction])


class MeasurementBuffer:
    def __init__(self, step: Propagation, seconds: float) -> None:
        """`step` propagates an estimate over an interval; `seconds` of the past are kept."""
        self._step = step
        self._kept_ns = round(seconds * 1e9)
        self._nodes: deque[BufferNode] = deque()

    @property
    def last(self) -> BufferNode:
        return self._nodes[-1]

    def begin(self, stamp_ns: int, interval: Interval, estimate: HorizontalEstimate) -> None:
        """Discard everything and start here."""
        self._nodes = deque([BufferNode(stamp_ns, interval, estimate)])

    def extend(self, stamp_ns: int, interval: Interval) -> None:
        """Append a node after this interval."""
        self._nodes.append(BufferNode(stamp_ns, interval, self._step(self.last.estimate, interval)))
        while len(self._nodes) > 2 and stamp_ns - self._nodes[1].stamp_ns >= self._kept_ns:
            self._nodes.popleft()

    def node_at(self, stamp_ns: int) -> BufferNode | None:
        """The node of this time [ns], inserted if necessary; None: before the first node. The last
        node, if the time is later."""
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

    def correct(self, node: BufferNode, correction: Correction) -> None:
        """Apply an accepted sample at its node, and run the filter again from there on."""
        node.corrections.append(correction)
        node.estimate = correction(node.estimate, node.interval)
        estimate, later = node.estimate, False
        for each in self._nodes:
            if later:
                estimate = self._step(estimate, each.interval)
                for old in each.corrections:
                    estimate = old(estimate, each.interval)
                each.estimate = estimate
            later = later or each is node

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
    """The attitude at this share [-] between a and b, which must be close (normalised lerp)."""
    sign = 1.0 if plain_sum(p * q for p, q in zip(a, b, strict=True)) >= 0.0 else -1.0
    w, x, y, z = (p + share * (sign * q - p) for p, q in zip(a, b, strict=True))
    return normalised((w, x, y, z))
