"""Two machines, two clocks: converting the other machine's stamps to local time.

A message's stamps are in the clock of the side that published it. Where topside and drone are two
machines, every node keeps the clock offset that the link monitor publishes, and the gates convert
the stamps of every message that crossed the link to local time. On one machine there is one clock
and nothing to do.
"""

from messages.link import Clock, ClockPing, ClockPong
from messages.topic import AnyTopic, Side, Way

DRIFT = 100e-6  # [-] at most, between two crystals of 50 ppm
ABOUT_CLOCKS = (Clock, ClockPing, ClockPong)  # never converted: they compare the two clocks


class ClockOffset:
    """What is known of the other machine's clock."""

    def __init__(self, side: Side) -> None:
        """The side this node is on."""
        self.ahead_ns: int | None = None  # [ns] the other clock minus this one; None: not known
        self._bound_ns = 0  # [ns] greatest error of the offset …
        self._learnt_ns = 0  # [ns] … at this time
        self._sign = 1 if side == "topside" else -1
        self._crossing = Way.UP if side == "topside" else Way.DOWN

    def bound_ns(self, now: int) -> int:
        """[ns] Greatest error of the offset; it grows while the link monitor is silent, because two
        crystals drift apart."""
        return self._bound_ns + round(DRIFT * max(0, now - self._learnt_ns))

    def learn(self, clock: Clock, now: int) -> None:
        """Keep the link monitor's newest message."""
        if clock.offset_ns is None or clock.bound_ns is None:
            self.ahead_ns = None
            return
        self.ahead_ns = self._sign * clock.offset_ns
        self._bound_ns, self._learnt_ns = clock.bound_ns, now

    def concerns(self, topic: AnyTopic) -> bool:
        """Does this topic come from the other machine?"""
        return topic.way is self._crossing and topic.message not in ABOUT_CLOCKS

    def local_ns(self, topic: AnyTopic, stamp_ns: int) -> int | None:
        """[ns] A stamp of this topic by the clock of this side; None where that is not known: not
        yet, or because the topic is published on both sides."""
        if topic.way is Way.BOTH:
            return None
        if topic.way is not self._crossing:
            return stamp_ns
        return None if self.ahead_ns is None else stamp_ns - self.ahead_ns

    def judges(self, topic: AnyTopic) -> bool:
        """Can its stamps be checked? Topics published on both sides may be of either clock."""
        return topic.way is not Way.BOTH and topic.message not in ABOUT_CLOCKS
