"""One override channel: from a share of an axis to the pulse that ArduSub reads as that share.

In MANUAL mode, ArduSub takes `norm_input` of the channel: RCn_MIN, RCn_TRIM, RCn_MAX and
RCn_REVERSED, clipped, without a dead band. The throttle of 4.5 has its trim at RC3_MIN and runs
from 0 to 1; that of 4.8 is as all others.
"""

from typing import NamedTuple

NEUTRAL = 1500  # [µs]


class RcChannel(NamedTuple):
    least: float = 1100.0  # [µs]
    trim: float = 1500.0  # [µs]
    most: float = 1900.0  # [µs]
    reversed: bool = False

    @property
    def neutral(self) -> float:
        """[µs] Where the axis is zero: the trim, or the middle where the trim is at the end."""
        return (self.least + self.most) / 2 if self.trim <= self.least else self.trim

    def pulse(self, share: float) -> float:
        """[µs] For a share -1 … 1 of the axis, not rounded."""
        share = max(-1.0, min(1.0, -share if self.reversed else share))
        middle = self.neutral
        return middle + share * ((self.most - middle) if share > 0 else (middle - self.least))

    def share(self, pulse: float) -> float:
        """[-] What ArduSub makes of a pulse [µs]."""
        middle = self.neutral
        span = (self.most - middle) if pulse > middle else (middle - self.least)
        share = max(-1.0, min(1.0, (pulse - middle) / span))
        return -share if self.reversed else share
