"""Control service: reference and state arrive, thruster commands leave."""

from messages import topics
from messages.reference import Reference
from services.control.core import Controller, Settings
from services.marine.vehicle import Vehicle
from services.runtime.node import Node
from services.runtime.stack import Stack

SILENCE_S = 0.1  # [s] without a reference: hold the last position


def wire(node: Node, stack: Stack) -> None:
    controller = Controller(stack.section("control", Settings), stack.section("vehicle", Vehicle))
    state = node.latest(topics.STATE)
    wrenches = node.publisher(topics.WRENCH)
    thrusters = node.publisher(topics.THRUSTERS)

    def on_reference(reference: Reference | None, now: int) -> None:
        wrench, command = controller.step(reference, state.fresh(now), now)
        wrenches.put(wrench)
        thrusters.put(command)
        while controller.happened:
            node.count(controller.happened.pop())

    node.trigger(topics.REFERENCE, on_reference, SILENCE_S)
