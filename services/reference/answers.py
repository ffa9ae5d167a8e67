"""What the drone answers to a request, and why it refuses one."""

from dataclasses import dataclass, field

import msgspec

from messages.pilot import PilotAnswer, PilotCommand, PilotRequest, StopDistance
from messages.units import Ns

KEPT = 64  # answers known by heart
CENTRED = 0.05  # [-] a stick this close to the middle counts as let go


def centred(command: PilotCommand) -> bool:
    return max(map(abs, (command.surge, command.sway, command.heave, command.yaw))) < CENTRED


def refusal(
    request: PilotRequest, command: PilotCommand | None, *, armed: bool, ready: bool, stopping: bool
) -> str:
    """Why a request cannot be granted now; empty when it can.

    Args:
        command: the newest fresh stick positions.
        ready: the drone knows its depth and attitude.
        stopping: it is coming to rest, by request or because something is missing.
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


@dataclass(slots=True)
class AnswerBook:
    """A request is repeated until its answer arrives: it is done once and answered each time."""

    _answers: dict[str, PilotAnswer] = field(default_factory=dict[str, PilotAnswer])

    def known(self, request: PilotRequest, now: Ns) -> PilotAnswer | None:
        """The answer already given to this request, to be said again."""
        answer = self._answers.get(request.id)
        return None if answer is None else msgspec.structs.replace(answer, stamp_ns=now)

    def write(
        self, request: PilotRequest, reason: str, stop: StopDistance | None, epoch: int, now: Ns
    ) -> PilotAnswer:
        """A new answer: accepted if there is no reason against it."""
        answer = PilotAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            reason=reason,
            stop=stop if request.kind == "stop" else None,
            epoch=epoch if request.kind == "lease" and not reason else None,
            cause_ns=request.stamp_ns,
        )
        self._answers[request.id] = answer
        if len(self._answers) > KEPT:
            del self._answers[next(iter(self._answers))]
        return answer
