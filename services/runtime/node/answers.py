"""The answering end of a request: a request is repeated until its answer arrives, so it is decided
once, and its answer is sent for every repetition."""

from collections.abc import Callable
from typing import Generic, TypeVar

import msgspec

from messages.message import Answer, Request
from messages.units import Ns

KEPT = 64  # newest answers, for requests that are repeated
Q = TypeVar("Q", bound=Request)
A = TypeVar("A", bound=Answer)


class AnswerBook(Generic[Q, A]):
    """Answers by the id of their request."""

    def __init__(self, decide: Callable[[Q, Ns], A]) -> None:
        self._decide = decide
        self._answers: dict[str, A] = {}  # the oldest first

    def answer(self, request: Q, now: Ns) -> tuple[A, bool]:
        """The answer to send now, and whether the request was decided just now."""
        if (known := self._answers.get(request.id)) is not None:
            return msgspec.structs.replace(known, stamp_ns=now), False
        answer = self._answers[request.id] = self._decide(request, now)
        if len(self._answers) > KEPT:
            del self._answers[next(iter(self._answers))]
        return answer, True
