"""One request to a service of a running dive, and its answer."""

import os
import threading
import time
from collections.abc import Callable
from typing import Generic

from messages.topic import Topic
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.launch.process_plan import HOME
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from services.runtime.node.requests import GIVE_UP_NS, A, Q

NO_PILOT = "nobody flies from this side now, so control cannot change hands"


class OneRequest(Generic[Q, A]):
    """A request, and its answer. `asked`: it was sent."""

    def __init__(self, node: Node, asks: Topic[Q], answers: Topic[A]) -> None:
        self.answer: A | None = None
        self.given_up = False
        self.asked = False
        self._asking = node.request(
            asks,
            answers,
            on_answer=self._keep,
            on_given_up=self._give_up,
            who=f"{node.name}-{os.getpid()}",
        )
        node.every(1e9 / GIVE_UP_NS, self._look)

    def ask(self, request: Q, now: int) -> None:
        """Send the request; later calls do nothing, because it is repeated automatically."""
        if not self.asked:
            self.asked = True
            self._asking.ask(request, now)

    def _keep(self, _request: Q, answer: A, _now: int) -> None:
        self.answer = answer

    def _look(self, _: int) -> None:
        """Give up if the request could not be sent at all."""
        self.given_up = self.given_up or not self.asked

    def _give_up(self, _request: Q, _now: int) -> None:
        self.given_up = True


def at_once(node: Node, request: Q, asks: Topic[Q], answers: Topic[A]) -> OneRequest[Q, A]:
    """Ask as soon as the node runs."""
    asking = OneRequest(node, asks, answers)
    node.alarm(lambda now: asking.ask(request, now)).set(0)
    return asking


def answer_to(ask: Callable[[Node], OneRequest[Q, A]], running: Running, who: str) -> A:
    """
    Args:
        ask: asks something through the node it is given.
        who: answers, for the error message.

    Raises:
        LindyError: nobody answers.
    """
    side = HOME if HOME in running.endpoints else next(iter(running.endpoints))
    woken = threading.Event()
    with open_bus(running.endpoints[side], running.vehicle) as bus:
        node = Node("ask", {side: bus}, time.monotonic_ns, VolatileCheckpoint(), visitor=True)
        node.wake = woken.set
        asking = ask(node)
        while asking.answer is None and not asking.given_up:
            woken.wait(max(0.0, (node.deadline() - time.monotonic_ns()) / 1e9))
            woken.clear()
            node.step()
    if not asking.asked:
        raise LindyError(f"{NO_PILOT}: open the page, or connect a pad, and ask again")
    if asking.answer is None:
        raise LindyError(f"the {who} does not answer")
    return asking.answer
