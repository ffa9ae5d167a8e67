"""Reference service: sticks and requests arrive, a smooth reference leaves with every state."""

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest
from messages.state import VehicleState
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

SILENCE_S = 0.1  # [s] without a state: stop smoothly and hold


def wire(node: Node, stack: Stack) -> None:
    before = node.recall(GuidanceCheckpoint) or GuidanceCheckpoint()
    pilotage = ReferenceGenerator(stack.section("reference", Settings), before)
    commands = node.latest(topics.PILOT_COMMAND)
    authority = commands.authority(before.epoch)
    reference = node.publisher(topics.REFERENCE)
    status = node.publisher(topics.STATUS)
    said: tuple[object, ...] = ()
    kept = pilotage.remembered

    def on_state(state: VehicleState | None, now: int) -> None:
        if (out := pilotage.step(state, commands.fresh(now), now)) is not None:
            reference.put(out)
        _tell(node, pilotage)
        keep()
        if said != _gist(pilotage, now):
            say_status(now)

    def decide(request: PilotRequest, now: int) -> PilotAnswer:
        answer = pilotage.answer(request, commands.fresh(now), authority.epoch, now)
        authority.granted = pilotage.epoch
        return answer

    def tell(request: PilotRequest, answer: PilotAnswer, now: int) -> None:
        if answer.accepted:
            node.log("info", f"{request.kind}: done")
        else:
            node.log("warning", f"{request.kind} refused: {answer.reason}")
        keep()
        say_status(now)

    def keep() -> None:
        nonlocal kept
        if kept != pilotage.remembered:
            kept = pilotage.remembered
            node.remember(kept)

    def say_status(now: int) -> None:
        nonlocal said
        said = _gist(pilotage, now)
        status.put(pilotage.status(commands.newest(now), now))

    node.trigger(topics.STATE, on_state, SILENCE_S)
    node.answers(topics.PILOT_REQUEST, topics.PILOT_ANSWER, decide, tell)
    node.every(topics.STATUS.hz, say_status)


def _tell(node: Node, pilotage: ReferenceGenerator) -> None:
    """Count and say what has happened."""
    while pilotage.happened:
        node.count(what := pilotage.happened.pop())
        node.log("warning", what)
    while pilotage.notes:
        node.log("info", pilotage.notes.pop())


def _gist(pilotage: ReferenceGenerator, now: int) -> tuple[object, ...]:
    """A status is said at once when this has changed."""
    status = pilotage.status(None, now)
    return status.mode, status.armed, status.hold, status.failsafe
