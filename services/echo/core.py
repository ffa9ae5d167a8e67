"""What the drone says to a ping."""

from messages.link import ClockPing, ClockPong


def pong(ping: ClockPing, heard_ns: int) -> ClockPong:
    """The answer to a ping that is handled now, `heard_ns` by the drone's clock."""
    return ClockPong(stamp_ns=heard_ns, ping_ns=ping.stamp_ns, heard_ns=heard_ns)
