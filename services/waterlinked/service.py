"""DVL service: velocity over the ground and altitude from a DVL A50 or A125."""

from messages import topics
from services.instruments.io.shell import connect
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.waterlinked.core import DvlDriver, Settings


def wire(node: Node, stack: Stack) -> None:
    if stack.virtual:
        raise NeedsRealTimeError(node.name)
    settings = stack.section(node.name, Settings)
    mounting = stack.section("vehicle", Vehicle).mounting
    driver = DvlDriver(settings, node.outbox, mounting.dvl.rotation)
    connect(node, settings.url, driver, topics.DVL)
    node.each(topics.DVL, driver.heard_other)
