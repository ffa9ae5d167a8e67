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
    leg: Interval  # that led here
    belief: HorizontalEstimate
    readings: list[Correction] = field(default_factory=list[Correction])


class MeasurementBuffer:
    def __init__(self, step: Propagation, seconds: float) -> None:
        """How a belief moves along a leg, and how much [s] of the past to keep."""
        self._step = step
        self._kept_ns = round(seconds * 1e9)
        self._stones: deque[BufferNode] = deque()

    @property
    def last(self) -> BufferNode:
        return self._stones[-1]

    def begin(self, stamp_ns: int, leg: Interval, belief: HorizontalEstimate) -> None:
        """Forget everything and start here."""
        self._stones = deque([BufferNode(stamp_ns, leg, belief)])

    def extend(self, stamp_ns: int, leg: Interval) -> None:
        """One leg further."""
        self._stones.append(BufferNode(stamp_ns, leg, self._step(self.last.belief, leg)))
        while len(self._stones) > 2 and stamp_ns - self._stones[1].stamp_ns >= self._kept_ns:
            self._stones.popleft()

    def stone_at(self, stamp_ns: int) -> BufferNode | None:
        """The stone of this time [ns], put there if need be; None: before the trail begins. What is
        newer than the last stone belongs there."""
        stones = self._stones
        if stamp_ns < stones[0].stamp_ns - SAME_NS:
            return None
        after = len(stones) - 1
        while after > 0 and stones[after - 1].stamp_ns >= stamp_ns - SAME_NS:
            after -= 1
        stone = stones[after]
        if stone.stamp_ns - stamp_ns <= SAME_NS:
            return stone
        return self._split(after, stamp_ns)

    def read(self, stone: BufferNode, reading: Correction) -> None:
        """Let an accepted sample of the stone's time change what is believed from there on."""
        stone.readings.append(reading)
        stone.belief = reading(stone.belief, stone.leg)
        belief, redo = stone.belief, False
        for each in self._stones:
            if redo:
                belief = self._step(belief, each.leg)
                for old in each.readings:
                    belief = old(belief, each.leg)
                each.belief = belief
            redo = redo or each is stone

    def _split(self, after: int, stamp_ns: int) -> BufferNode:
        before, late = self._stones[after - 1], self._stones[after]
        share = (stamp_ns - before.stamp_ns) / (late.stamp_ns - before.stamp_ns)
        leg = late.leg
        attitude = between(before.leg.attitude, leg.attitude, share)
        first = leg._replace(seconds=share * leg.seconds, attitude=attitude)
        stone = BufferNode(stamp_ns, first, self._step(before.belief, first))
        late.leg = leg._replace(seconds=(1.0 - share) * leg.seconds)
        self._stones.insert(after, stone)
        return stone


def between(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    """The attitude at this share [-] of the way from a to b, which are not far apart."""
    sign = 1.0 if sum(p * q for p, q in zip(a, b, strict=True)) >= 0.0 else -1.0
    w, x, y, z = (p + share * (sign * q - p) for p, q in zip(a, b, strict=True))
    return normalised((w, x, y, z))
