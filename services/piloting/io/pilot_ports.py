"""What every pilot does on the bus: it publishes commands, asks requests and keeps a checkpoint."""

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from services.piloting.pilot import Effects, Pilot, Progress
from services.piloting.pilot_intents import overrules
from services.runtime.node.node import Node

E = TypeVar("E", bound=Effects)
E_co = TypeVar("E_co", bound=Effects, covariant=True)


class HearsAnswers(Protocol[E_co]):
    """A pilot, or what has one."""

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: int) -> E_co: ...
    def given_up(self, request: PilotRequest, now: int) -> E_co: ...


def restored(node: Node) -> Progress:
    """How far the pilot was before this service was restarted."""
    return node.restore_checkpoint(Progress) or Progress()


class PilotPorts(Generic[E]):
    """Carries out the effects of a pilot on a node."""

    def __init__(
        self,
        node: Node,
        pilot: Pilot,
        hears: HearsAnswers[E],
        also: Callable[[E, int], None] = lambda _effects, _now: None,
    ) -> None:
        """
        Args:
            pilot: its progress is the checkpoint.
            hears: is told of each request's answer, or that there was none.
            also: carries out what the effects cause beyond those of every pilot.
        """
        self._node, self._pilot, self._hears, self._also = node, pilot, hears, also
        self._kept = pilot.progress
        pilot.asked = self._waiting
        self._commands = node.publisher(topics.PILOT_COMMAND)
        self._asking = node.request(
            topics.PILOT_REQUEST,
            topics.PILOT_ANSWER,
            on_answer=self._on_answer,
            on_given_up=self._on_given_up,
            overrules=overrules,
        )

    def _waiting(self) -> set[RequestKind]:
        """Kinds of the requests that have not been answered yet."""
        return {pending.request.kind for pending in self._asking.pending}

    def do(self, effects: E, now: int) -> None:
        if effects.command is not None:
            self._commands.put(effects.command)
        for request in effects.requests:
            self._asking.ask(request, now)
        if self._kept != self._pilot.progress:
            self._kept = self._pilot.progress
            self._node.save_checkpoint(self._kept)
        self._also(effects, now)

    def _on_answer(self, request: PilotRequest, answer: PilotAnswer, now: int) -> None:
        self.do(self._hears.answered(request, answer, now), now)

    def _on_given_up(self, request: PilotRequest, now: int) -> None:
        self.do(self._hears.given_up(request, now), now)
