"""What is asked of the running link, and the answer; each request is carried out once."""

from collections import OrderedDict

from msgspec.structs import replace

from messages.link import LinkAnswer, LinkRequest
from services.runtime.bus import Envelope
from services.runtime.errors import LindyError
from services.tether.core import Link
from services.tether.profile_file import Named, adjusted, named

REMEMBERED = 64  # newest answers, for requests that are repeated


class Changer:
    """Knows the profile in force."""

    def __init__(self, link: Link[Envelope], in_force: Named) -> None:
        self._link = link
        self._in_force = in_force
        self._answers: OrderedDict[str, LinkAnswer] = OrderedDict()

    def answer(self, request: LinkRequest, now: int) -> tuple[LinkAnswer, bool]:
        """The answer, and whether it is the first to this request."""
        if (known := self._answers.get(request.id)) is not None:
            return replace(known, stamp_ns=now), False
        change, reason = "", ""
        try:
            change = self._carry_out(request, now)
        except LindyError as error:
            reason = str(error)
        answer = LinkAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            kind=request.kind,
            change=change,
            reason=reason,
            cause_ns=request.stamp_ns,
        )
        self._answers[request.id] = answer
        if len(self._answers) > REMEMBERED:
            self._answers.popitem(last=False)
        return answer, True

    def _carry_out(self, request: LinkRequest, now: int) -> str:
        """In words, what has changed.

        Raises:
            LindyError: why it cannot be done; nothing has changed then.
        """
        match request.kind:
            case "down":
                self._link.cut(now)
                return "the link is cut"
            case "up":
                self._link.restore(now)
                return "the link is there again"
            case "profile":
                if request.profile is None:
                    raise LindyError("no profile is named")
                before, after = self._in_force, named(request.profile)
                words = f"profile {before.name} → {after.name}"
            case "set":
                after, words = adjusted(self._in_force, request.settings)
        self._in_force = after
        self._link.change(after.name, after.profile, now)
        return words
