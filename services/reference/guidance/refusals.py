"""Why the drone refuses a request of the pilot who has control."""

from messages import events
from messages.pilot import MANOEUVRES, PilotAnswer, PilotCommand, PilotRequest
from messages.units import Ns
from services.reference.guidance.axes import centred


def refusal(
    request: PilotRequest,
    command: PilotCommand | None,
    *,
    armed: bool,
    ready: bool,
    stopping: bool,
    acting: bool,
    board: bool = True,
) -> str:
    """Why a request cannot be granted now; empty when it can.

    Args:
        command: the newest fresh stick positions.
        ready: the drone knows its depth and attitude.
        stopping: coming to rest, by request.
        acting: a failsafe acts.
        board: the vehicle's board answers.
    """
    if request.kind == "arm" and not board:
        return events.BOARD_SILENT.sentence
    if request.kind == "arm" and not armed:
        if not ready:
            return "the drone does not know its depth and attitude yet"
        if command is None or command.pilot == "lost":
            return "no pilot: no fresh stick positions arrive"
        if not centred(command):
            return "the sticks are not centred"
    moves = request.kind in MANOEUVRES
    if moves and not armed:
        return "the drone is not armed"
    if (moves or request.kind == "mode") and armed and acting:
        return "a failsafe acts; first resume"
    if moves and armed and stopping:
        return "the drone is stopping; ask again when it is at rest"
    if moves and command is not None and not centred(command):
        return "the sticks are not centred, and they have priority"
    return ""


def refused(request: PilotRequest, reason: str, now: Ns) -> PilotAnswer:
    """The answer to a request that is not carried out."""
    return PilotAnswer(
        stamp_ns=now,
        id=request.id,
        accepted=False,
        reason=reason,
        cause_ns=request.stamp_ns,
    )
