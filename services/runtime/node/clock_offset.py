"""Two machines, two clocks: what a stamp of the other one means here.

A message's stamps are in the clock of the side it was said on. Where the drone is a machine of
its own, every node keeps what the link monitor says of the two clocks, and the gates turn the
stamps of whatever crossed the link into local time. On one machine there is one clock and nothing
to do.
"""

from messages.link import Clock, ClockPing, ClockPong
from messages.topic import AnyTopic, Side, Way

DRIFT = 100e-6  # [-] at most, between two crystals of 50 ppm
ABOUT_CLOCKS = (Clock, ClockPing, ClockPong)  # they carry each clock's own time, untouched


class ClockOffset:
    """What is known of the other machine's clock."""

    def __init__(self, side: Side) -> None:
        """The side this node is on."""
        self.ahead_ns: int | None = None  # [ns] the other clock minus this one; None: not known
        self._bound_ns = 0  # [ns] it was no further off than this …
        self._learnt_ns = 0  # [ns] … when this was learnt
        self._sign = 1 if side == "topside" else -1
        self._crossing = Way.UP if side == "topside" else Way.DOWN

    def bound_ns(self, now: int) -> int:
        """[ns] The other clock is no further off than this; it grows while the link monitor is
        silent,
        because two crystals drift apart."""
        return self._bound_ns + round(DRIFT * max(0, now - self._learnt_ns))

    def learn(self, clock: Clock, now: int) -> None:
        """Keep the link monitor's newest word."""
        if clock.offset_ns is None or clock.bound_ns is None:
            self.ahead_ns = None
            return
        self.ahead_ns = self._sign * clock.offset_ns
        self._bound_ns, self._learnt_ns = clock.bound_ns, now

    def concerns(self, topic: AnyTopic) -> bool:
        """Does this stream come from the other machine?"""
        return topic.way is self._crossing and topic.message not in ABOUT_CLOCKS

    def local_ns(self, topic: AnyTopic, stamp_ns: int) -> int | None:
        """[ns] A stamp of this stream by the clock of this side; None where that is not known: not
        yet, or because the row is said on both sides."""
        if topic.way is Way.BOTH:
            return None
        if topic.way is not self._crossing:
            return stamp_ns
        return None if self.ahead_ns is None else stamp_ns - self.ahead_ns

    def judges(self, topic: AnyTopic) -> bool:
        """Can its stamps be judged? Rows said on both sides may be of either clock."""
        return topic.way is not Way.BOTH and topic.message not in ABOUT_CLOCKS
