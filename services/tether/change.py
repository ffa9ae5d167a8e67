"""Requests that change the running link, and their answers."""

from collections.abc import Callable
from typing import Any

from messages.link import LinkAnswer, LinkRequest
from messages.units import Ns
from services.tether.core import Link
from services.tether.profile import Named

# (request, profile in force) → the new profile and what changes, in words; or why it is refused.
Read = Callable[[LinkRequest, Named], tuple[Named, str] | str]


class Changer:
    """Keeps the profile in force; `read` reads profile files."""

    def __init__(self, link: Link[Any], in_force: Named, read: Read) -> None:
        self._link = link
        self._in_force = in_force
        self._read = read

    def answer(self, request: LinkRequest, now: Ns) -> LinkAnswer:
        """Change the link, or refuse with a reason and change nothing."""
        change, reason = self._carry_out(request, now)
        return LinkAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            kind=request.kind,
            change=change,
            reason=reason,
            cause_ns=request.stamp_ns,
        )

    def _carry_out(self, request: LinkRequest, now: Ns) -> tuple[str, str]:
        """In words: (what has changed, why nothing has); one of the two is empty."""
        if request.kind == "down":
            self._link.cut(now)
            return "the link is cut", ""
        if request.kind == "up":
            self._link.restore(now)
            return "the link is restored", ""
        found = self._read(request, self._in_force)
        if isinstance(found, str):
            return "", found
        self._in_force, words = found
        self._link.change(self._in_force.name, self._in_force.profile, now)
        return words, ""
