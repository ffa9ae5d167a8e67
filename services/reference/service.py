"""Reference service: sticks and requests arrive, a smooth reference leaves with every state."""

from messages import topics
from messages.pilot import PilotRequest
from messages.state import VehicleState
from services.reference.core import Pilotage, Remembered, Settings
from services.runtime.node import Node
from services.runtime.stack import Stack

SILENCE_S = 0.1  # [s] without a state: stop smoothly and hold


def wire(node: Node, stack: Stack) -> None:
    before = node.recall(Remembered) or Remembered(armed=False, light=0.0)
    pilotage = Pilotage(
        stack.section("reference", Settings), armed=before.armed, light=before.light
    )
    commands = node.latest(topics.PILOT_COMMAND)
    reference = node.publisher(topics.REFERENCE)
    answers = node.publisher(topics.PILOT_ANSWER)
    status = node.publisher(topics.STATUS)
    shown = ""

    def on_state(state: VehicleState | None, now: int) -> None:
        if (out := pilotage.step(state, commands.fresh(now), now)) is not None:
            reference.put(out)
        while pilotage.happened:
            node.count(what := pilotage.happened.pop())
            node.log("warning", what)
        say_status_if_changed(now)

    def on_request(request: PilotRequest, now: int) -> None:
        answer, changed = pilotage.answer(request, commands.fresh(now), now)
        answers.put(answer)
        if changed:
            node.remember(Remembered(armed=pilotage.armed, light=pilotage.light))
            node.log("info", f"{request.kind}: done")
        elif not answer.accepted:
            node.log("warning", f"{request.kind} refused: {answer.reason}")
        say_status_if_changed(now)

    def say_status(now: int) -> None:
        nonlocal shown
        message = pilotage.status(commands.newest(now), now)
        status.put(message)
        shown = f"{message.mode} {message.armed} {message.failsafe}"

    def say_status_if_changed(now: int) -> None:
        message = pilotage.status(None, now)
        if shown != f"{message.mode} {message.armed} {message.failsafe}":
            say_status(now)

    node.trigger(topics.STATE, on_state, SILENCE_S)
    node.each(topics.PILOT_REQUEST, on_request)
    node.every(topics.STATUS.hz, say_status)
