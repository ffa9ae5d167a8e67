"""Underwater GPS service: fixes of the vehicle's locator, asked for over HTTP."""

from functools import partial

from messages import topics
from messages.events import Outbox
from messages.sensors import UsblSample
from services.instruments.io.shell import Instrument, connect, local_fixes
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.ugps.core import PATHS, Settings, UgpsDriver
from services.ugps.io.poller import HttpPoller


def opened(
    stack: Stack, name: str, outbox: Outbox, node: Node | None = None
) -> Instrument[UsblSample] | None:
    settings = stack.section(name, Settings)
    if not settings.url:
        return None
    fixes = local_fixes(stack, name, "ugps", outbox, node)
    poller = HttpPoller(settings.url, f"{name}.url", PATHS, 1.0 / settings.rate, outbox)
    return Instrument(UgpsDriver(settings, fixes, outbox), poller)


def wire(node: Node, stack: Stack) -> None:
    connect(node, stack, partial(opened, node=node), topics.USBL, other="gnss")
