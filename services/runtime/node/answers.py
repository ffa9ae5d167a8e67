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


class KeptAnswers(Generic[A]):
    """The newest answers, by the id of their request."""

    def __init__(self) -> None:
        self._answers: dict[str, A] = {}  # the oldest first

    def keep(self, answer: A) -> A:
        self._answers[answer.id] = answer
        if len(self._answers) > KEPT:
            del self._answers[next(iter(self._answers))]
        return answer

    def to(self, request_id: str, now: Ns) -> A | None:
        """The answer to a request that is repeated; None: it has none yet."""
        known = self._answers.get(request_id)
        return None if known is None else msgspec.structs.replace(known, stamp_ns=now)


class AnswerBook(Generic[Q, A]):
    """Answers of who decides at once."""

    def __init__(self, decide: Callable[[Q, Ns], A]) -> None:
        self._decide = decide
        self._kept = KeptAnswers[A]()

    def answer(self, request: Q, now: Ns) -> tuple[A, bool]:
        """The answer to send now, and whether the request was decided just now."""
        if (known := self._kept.to(request.id, now)) is not None:
            return known, False
        return self._kept.keep(self._decide(request, now)), True
