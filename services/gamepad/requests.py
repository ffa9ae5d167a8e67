"""Requests to the drone: each is repeated with the same id until it is answered."""

import msgspec

from messages.pilot import Course, Hold, PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns

REPEAT_NS = 200_000_000  # [ns]
GIVE_UP_NS = 5_000_000_000  # [ns]
OVERRULES: dict[RequestKind, tuple[RequestKind, ...]] = {
    "stop": ("arm", "goto", "follow", "mode"),
    "disarm": ("arm", "goto", "follow"),
    "goto": ("goto", "follow", "mode"),
    "follow": ("goto", "follow", "mode"),
    "mode": ("goto", "follow", "mode"),
}  # a newer request → older ones that are not repeated any more


class Pending(msgspec.Struct):
    request: PilotRequest  # as it was first sent
    repeat_at: Ns  # [ns]


class Requests:
    """What was asked and not yet answered. `who` and the time of asking make the ids unique."""

    def __init__(self, who: str) -> None:
        self._who = who
        self._asked = 0
        self._pending: list[Pending] = []

    def ask(
        self,
        kind: RequestKind,
        now: int,
        value: float | None = None,
        *,
        depth: float | None = None,
        heading: float | None = None,
        north: float | None = None,
        east: float | None = None,
        course: Course | None = None,
        hold: Hold | None = None,
    ) -> PilotRequest:
        """A new request, to be sent at once; its fields are those of `PilotRequest`.

        It withdraws what it overrules, so that no late repetition arms the drone or sends it off
        again after a stop, or back to where it was sent before.
        """
        overruled = OVERRULES.get(kind, ())
        self._pending = [p for p in self._pending if p.request.kind not in overruled]
        request = PilotRequest(
            stamp_ns=now,
            id=f"{self._who}-{now}-{self._asked}",
            kind=kind,
            value=value,
            depth=depth,
            heading=heading,
            north=north,
            east=east,
            course=course,
            hold=hold,
        )
        self._asked += 1
        self._pending.append(Pending(request, now + REPEAT_NS))
        return request

    def waits_for(self, kind: RequestKind) -> bool:
        return any(p.request.kind == kind for p in self._pending)

    def answered(self, answer: PilotAnswer) -> PilotRequest | None:
        """The request that this answers; None when it is not ours or was answered before."""
        for pending in self._pending:
            if pending.request.id == answer.id:
                self._pending.remove(pending)
                return pending.request
        return None

    def repeats(self, now: int) -> list[PilotRequest]:
        """Requests to be sent again, stamped anew because a receiver refuses what is older than
        what it has already seen."""
        due = [p for p in self._pending if p.repeat_at <= now]
        for pending in due:
            pending.repeat_at = now + REPEAT_NS
        return [msgspec.structs.replace(p.request, stamp_ns=now) for p in due]

    def given_up(self, now: int) -> list[PilotRequest]:
        """Requests that have waited too long; they are forgotten."""
        late = [p for p in self._pending if p.request.stamp_ns + GIVE_UP_NS <= now]
        self._pending = [p for p in self._pending if p not in late]
        return [p.request for p in late]
