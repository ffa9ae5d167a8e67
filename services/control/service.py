"""Control service: reference and state in, thruster commands out. While `reference` is silent, the
pilot's disarm and stop are answered here."""

from messages import topics
from messages.events import Outbox
from messages.pilot import PilotRequest
from messages.reference import Reference
from services.control.core import Controller, DisarmFallback, Settings
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

SILENCE_S = 0.1  # [s] without a reference: hold the last position


def wire(node: Node, stack: Stack) -> None:
    controller = _controller(stack, node.outbox)
    state = node.latest(topics.STATE)
    wrenches = node.publisher(topics.WRENCH)
    thrusters = node.publisher(topics.THRUSTERS)
    answers = node.publisher(topics.PILOT_ANSWER)
    handed_on = node.publisher(topics.HANDED_ON)
    disarm_fallback = DisarmFallback(controller.latch, node.outbox)

    def on_reference(reference: Reference | None, now: int) -> None:
        act(reference, now)
        for request in disarm_fallback.heard(reference, now):
            handed_on.put(request)

    def act(reference: Reference | None, now: int) -> None:
        wrench, command = controller.step(reference, state.fresh(now), now)
        wrenches.put(wrench)
        thrusters.put(command)

    def on_request(request: PilotRequest, now: int) -> None:
        disarms, answer = disarm_fallback.hear(request, now)
        if disarms:
            act(None, now)
        if answer is not None:
            answers.put(answer)
            node.log("warning", f"{request.kind}: done by control; reference does not answer")

    node.each(topics.PILOT_REQUEST, on_request)
    node.trigger(topics.REFERENCE, on_reference, SILENCE_S)


def _controller(stack: Stack, outbox: Outbox) -> Controller:
    """
    Raises:
        LindyError: unstable gains, or thrusters that cannot drive the axes a pilot needs.
    """
    settings, vehicle = stack.section("control", Settings), stack.section("vehicle", Vehicle)
    try:
        return Controller(settings, vehicle, outbox)
    except ValueError as error:
        raise LindyError(f"{stack.vehicle_path}: {error}") from None
