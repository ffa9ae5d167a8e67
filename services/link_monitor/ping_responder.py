"""The drone's end: answers a ping with the drone's own time."""

from messages.link import ClockPing, ClockPong
from messages.units import Ns


def pong(ping: ClockPing, heard_ns: Ns) -> ClockPong:
    """The answer to a ping that is handled at `heard_ns` by the drone's clock."""
    return ClockPong(
        stamp_ns=heard_ns, ping_ns=ping.stamp_ns, heard_ns=heard_ns, source=ping.source
    )
