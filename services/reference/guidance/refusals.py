"""Why the drone refuses a request."""

from messages.pilot import FOR_ANYBODY, PilotCommand, PilotRequest

CENTRED = 0.05  # [-] a stick this close to the middle counts as centred


def centred(command: PilotCommand) -> bool:
    return max(map(abs, (command.surge, command.sway, command.heave, command.yaw))) < CENTRED


def usurped(request: PilotRequest, in_force: int, granted: int) -> str:
    """Why the sender has no authority; empty when it has.

    Args:
        in_force: authority epoch of the newest command.
        granted: newest epoch granted; its owner may not have moved a stick yet.
    """
    if request.kind in FOR_ANYBODY or in_force <= request.epoch <= granted:
        return ""
    if request.epoch < in_force:
        return "another pilot has the sticks; ask for them first (lease)"
    return "the drone has not given you the sticks; ask for them first (lease)"


def refusal(
    request: PilotRequest, command: PilotCommand | None, *, armed: bool, ready: bool, stopping: bool
) -> str:
    """Why a request cannot be granted now; empty when it can.

    Args:
        command: the newest fresh stick positions.
        ready: the drone knows its depth and attitude.
        stopping: coming to rest, by request or by failsafe.
    """
    if request.kind == "arm" and not armed:
        if not ready:
            return "the drone does not know its depth and attitude yet"
        if command is None or command.pilot == "lost":
            return "no pilot: no fresh stick positions arrive"
        if not centred(command):
            return "the sticks are not centred"
    if request.kind == "lease" and command is not None and not centred(command):
        return "another pilot is moving the sticks"
    if request.kind in ("goto", "follow") and not armed:
        return "the drone is not armed"
    if request.kind in ("goto", "follow", "mode") and armed and stopping:
        return "the drone is stopping"
    if request.kind in ("goto", "follow") and command is not None and not centred(command):
        return "the sticks are not centred, and they have priority"
    return ""
