"""Echo sounder service: the altitude above the bottom from a Ping1D."""

from messages import topics
from messages.events import Outbox
from messages.sensors import AltitudeSample
from services.instruments.io.shell import Instrument, connect, on_links
from services.ping.core import PingDriver, Settings
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node


def opened(stack: Stack, name: str, outbox: Outbox) -> Instrument[AltitudeSample] | None:
    settings = stack.section(name, Settings)
    return on_links(settings.url, name, PingDriver(settings, outbox), outbox)


def wire(node: Node, stack: Stack) -> None:
    connect(node, stack, opened, topics.ALTITUDE)
