"""Echo service: a ping comes down the tether, a pong goes up."""

from messages import topics
from messages.link import ClockPing
from services.echo.core import pong
from services.runtime.node import Node
from services.runtime.stack import Stack


def wire(node: Node, _: Stack) -> None:
    pongs = node.publisher(topics.CLOCK_PONG)

    def on_ping(ping: ClockPing, now: int) -> None:
        pongs.put(pong(ping, now))

    node.each(topics.CLOCK_PING, on_ping)
