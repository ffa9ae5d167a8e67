"""DVL service: velocity over the ground and altitude from a DVL A50 or A125."""

from messages import topics
from messages.events import Outbox
from messages.sensors import DvlSample
from services.instruments.io.shell import Instrument, connect, on_links
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.waterlinked.core import DvlDriver, Settings


def opened(stack: Stack, name: str, outbox: Outbox) -> Instrument[DvlSample] | None:
    settings = stack.section(name, Settings)
    mounting = stack.section("vehicle", Vehicle).mounting
    driver = DvlDriver(settings, outbox, mounting.dvl.rotation)
    return on_links(settings.url, name, driver, outbox)


def wire(node: Node, stack: Stack) -> None:
    connect(node, stack, opened, topics.DVL, measures=lambda sample: sample.velocity is not None)
