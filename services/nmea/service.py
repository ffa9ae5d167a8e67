"""GNSS service: fixes of the vehicle while it floats, from a receiver that speaks NMEA 0183."""

from functools import partial

from messages import topics
from messages.events import Outbox
from messages.sensors import UsblSample
from services.instruments.io.shell import Instrument, connect, local_fixes, on_links
from services.nmea.core import GnssDriver, Settings
from services.nmea.io.sentences import NmeaReader
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node


def opened(
    stack: Stack, name: str, outbox: Outbox, node: Node | None = None
) -> Instrument[UsblSample] | None:
    settings = stack.section(name, Settings)
    if not settings.url:  # without one, pynmea2 is not needed
        return None
    fixes = local_fixes(stack, name, "gnss", outbox, node)
    driver = GnssDriver(settings, fixes, outbox, NmeaReader().read)
    return on_links(settings.url, name, driver, outbox)


def wire(node: Node, stack: Stack) -> None:
    connect(node, stack, partial(opened, node=node), topics.USBL, other="ugps")
