"""Requests: repeated with the same id until they are answered or given up, and decided once.

`Requests` is the state machine of who asks; `Requester` gives it a publisher and a timer, and is
made by `Node.request`. `AnswerBook` is the end that answers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import msgspec

from messages.message import Answer, Request
from messages.units import Ns
from services.runtime.node.ports import Alarm, Publisher

REPEAT_NS = 200_000_000  # [ns]
GIVE_UP_NS = 5_000_000_000  # [ns]
KEPT = 64  # newest answers, for requests that are repeated
Q = TypeVar("Q", bound=Request)
A = TypeVar("A", bound=Answer)
Overrules = Callable[[Q, Q], bool]  # (newer, older): does the newer withdraw the older one?


@dataclass(slots=True)
class Pending(Generic[Q]):
    request: Q  # as it was first sent
    repeat_at: Ns  # [ns]
    given_up_at: Ns  # [ns]


class Requests(Generic[Q]):
    """Requests that are not answered yet. `who` and the time of sending make the ids unique."""

    def __init__(self, who: str, overrules: Overrules[Q] = lambda _newer, _older: False) -> None:
        self._who = who
        self._overrules = overrules
        self._asked = 0
        self.pending: list[Pending[Q]] = []  # oldest first; always this list

    def ask(self, request: Q, now: Ns) -> Q:
        """The request with a stamp and an id, to be sent at once.

        It withdraws the older requests that it overrules, so that no late repetition undoes it.
        """
        asked = msgspec.structs.replace(
            request, stamp_ns=now, id=f"{self._who}-{now}-{self._asked}"
        )
        self._asked += 1
        self.pending[:] = [p for p in self.pending if not self._overrules(asked, p.request)]
        self.pending.append(Pending(asked, now + REPEAT_NS, now + GIVE_UP_NS))
        return asked

    def answered(self, answer: Answer) -> Q | None:
        """The request that this answers; None when it is not ours, or was answered before."""
        for pending in self.pending:
            if pending.request.id == answer.id:
                self.pending.remove(pending)
                return pending.request
        return None

    def given_up(self, now: Ns) -> list[Q]:
        """Requests that have waited too long; they are removed."""
        late = [p for p in self.pending if p.given_up_at <= now]
        self.pending[:] = [p for p in self.pending if p not in late]
        return [p.request for p in late]

    def repeats(self, now: Ns) -> list[Q]:
        """Requests to be sent again, stamped anew because a receiver refuses what is older than
        what it has already seen."""
        due = [p for p in self.pending if p.repeat_at <= now]
        for pending in due:
            pending.repeat_at = now + REPEAT_NS
        return [msgspec.structs.replace(p.request, stamp_ns=now) for p in due]

    def due(self) -> Ns | None:
        """[ns] When there is something to repeat or to give up; None: nothing is pending."""
        return min((min(p.repeat_at, p.given_up_at) for p in self.pending), default=None)


class Requester(Generic[Q, A]):
    """Sends the requests of one service. Made by `Node.request`."""

    def __init__(
        self,
        requests: Requests[Q],
        publisher: Publisher[Q],
        alarm: Callable[[Callable[[int], None]], Alarm],
        on_answer: Callable[[Q, A, int], None],
        on_given_up: Callable[[Q, int], None],
    ) -> None:
        self._requests = requests
        self._publisher = publisher
        self._on_answer = on_answer
        self._on_given_up = on_given_up
        self._alarm = alarm(self._look)
        self.pending = requests.pending  # what is not answered yet

    def ask(self, request: Q, now: int) -> None:
        """Send a request now and repeat it until it is answered; fills in its stamp and id."""
        self._publisher.put(self._requests.ask(request, now))
        self._alarm.set(self._requests.due())

    def hear(self, answer: A, now: int) -> None:
        request = self._requests.answered(answer)
        self._alarm.set(self._requests.due())
        if request is not None:  # else another one's, or the answer to a repetition
            self._on_answer(request, answer, now)

    def _look(self, now: int) -> None:
        """Repeat or give up what is due."""
        given_up, repeats = self._requests.given_up(now), self._requests.repeats(now)
        self._alarm.set(self._requests.due())
        for request in given_up:
            self._on_given_up(request, now)
        for request in repeats:
            self._publisher.put(request)


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
