"""Where a service's wiring is found: `services.<name>.service.wire(node, stack)`."""

import importlib
from collections.abc import Callable

from services.runtime.node import Node
from services.runtime.stack import Stack

Wire = Callable[[Node, Stack], None]


def wiring(service: str) -> Wire:
    """The function that connects a service's thinking to its ports."""
    return importlib.import_module(f"services.{service}.service").wire
