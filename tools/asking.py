"""One request to a service of a dive that is going on, and its answer."""

import os
import threading
import time
from typing import Any, Generic

import msgspec

from messages.topic import AnyTopic, M, Topic
from services.runtime.errors import LindyError
from services.runtime.local_stack import HOME
from services.runtime.memory import VolatileMemory
from services.runtime.node import Node
from services.runtime.running import Running
from services.runtime.zenoh_bus import open_bus

REPEAT_HZ = 5.0  # [1/s] until it is answered
PATIENCE_NS = 5_000_000_000  # [ns] how long it may take


def answer_to(
    request: msgspec.Struct, asks: AnyTopic, answers: Topic[M], running: Running, who: str
) -> M:
    """
    Args:
        request: without id and stamp; asks, answers: the two streams.
        who: answers, for the error message.

    Raises:
        LindyError: nobody answers.
    """
    endpoint = running.endpoints.get(HOME) or next(iter(running.endpoints.values()))
    woken = threading.Event()
    with open_bus(endpoint, running.vehicle) as bus:
        node = Node("asking", {HOME: bus}, time.monotonic_ns, VolatileMemory())
        node.wake = woken.set
        asking = Asking(node, request, asks, answers, f"ask-{os.getpid()}-{time.monotonic_ns()}")
        while asking.answer is None and not asking.given_up:
            woken.wait(max(0.0, (node.deadline() - time.monotonic_ns()) / 1e9))
            woken.clear()
            node.step()
    if asking.answer is None:
        raise LindyError(f"the {who} does not answer")
    return asking.answer


class Asking(Generic[M]):
    """One request, repeated with the same id until it is answered or has waited too long."""

    def __init__(
        self, node: Node, request: Any, asks: AnyTopic, answers: Topic[M], id_: str
    ) -> None:
        self.answer: M | None = None
        self.given_up = False
        self._request = msgspec.structs.replace(request, id=id_)
        self._asked_at: int | None = None  # [ns]
        self._publisher = node.publisher(asks)
        node.each(answers, self._hear)
        node.every(REPEAT_HZ, self._look)

    def _look(self, now: int) -> None:
        if self._asked_at is None:
            self._asked_at = now
        self.given_up = now - self._asked_at >= PATIENCE_NS
        if self.answer is None and not self.given_up:
            self._publisher.put(msgspec.structs.replace(self._request, stamp_ns=now))

    def _hear(self, answer: Any, _: int) -> None:
        if answer.id == self._request.id:
            self.answer = answer
