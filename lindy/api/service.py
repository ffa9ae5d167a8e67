"""To write a service or a driver: `wire(node, stack)` in a module that a stack file names.

docs/your-own-service.md, docs/your-own-vehicle.md"""

from messages import events
from messages.events import Event, Level
from messages.units import FiniteSetting, NotNegativeSetting, OpenShare, Share
from services.runtime.config.stack import Stack
from services.runtime.node.gate import Gate
from services.runtime.node.node import Node
from services.runtime.node.ports import Latest, Publisher
from services.vehicle.actuation import OpenLoopThrust
from services.vehicle.actuator_gate import ActuatorGate

__all__ = [
    "ActuatorGate",
    "Event",
    "FiniteSetting",
    "Gate",
    "Latest",
    "Level",
    "Node",
    "NotNegativeSetting",
    "OpenLoopThrust",
    "OpenShare",
    "Publisher",
    "Share",
    "Stack",
    "events",
]
