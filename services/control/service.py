"""Control service: reference and state in, thruster commands out."""

from messages import topics
from messages.reference import Reference
from services.control.core import Controller, Settings
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

SILENCE_S = 0.1  # [s] without a reference: hold the last position


def wire(node: Node, stack: Stack) -> None:
    controller = _controller(stack)
    state = node.latest(topics.STATE)
    actuation = node.latest(topics.ACTUATION)
    wrenches = node.publisher(topics.WRENCH)
    thrusters = node.publisher(topics.THRUSTERS)

    def on_reference(reference: Reference | None, now: int) -> None:
        newest = state.fresh(now)
        controller.heard(actuation.fresh(now), newest)
        wrench, command = controller.step(reference, newest, now)
        wrenches.put(wrench)
        thrusters.put(command)
        while controller.events:
            node.count(controller.events.pop())

    node.trigger(topics.REFERENCE, on_reference, SILENCE_S)


def _controller(stack: Stack) -> Controller:
    """
    Raises:
        LindyError: unstable gains, or thrusters that cannot drive the axes a pilot needs.
    """
    settings, vehicle = stack.section("control", Settings), stack.section("vehicle", Vehicle)
    try:
        return Controller(settings, vehicle)
    except ValueError as error:
        raise LindyError(f"{stack.vehicle_path}: {error}") from None
