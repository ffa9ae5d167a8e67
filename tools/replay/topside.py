"""Feeds services on the topside what was recorded on board, on virtual time.

The recorder heard the drone's bus only. When a message arrived topside follows from the emulated
link, which is run again with the profile and the seed of the dive: the same traffic meets the same
fate. What was lost on its way down is not in the recording.
"""

from collections import deque
from collections.abc import Callable, Iterable

from messages import topics
from messages.topic import AnyTopic, Direction
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from tools.recordings.recording import Raw
from tools.replay.differences import Told
from tools.replay.feed import Encoder
from tools.replay.outputs import Outputs, told_of
from tools.replay.source import ReplaySource

GATEWAY, RECORDER = "tether", "recorder"
PUBLISHER = {  # of rows that go down and do not say it in their key
    topics.PILOT_COMMAND.key: "gamepad",
    topics.PILOT_REQUEST.key: "gamepad",
    topics.PREDICTION.key: "predictor",
}


class Topside:
    """One replay. `recorded` is filled while `run` runs."""

    def __init__(
        self, source: ReplaySource, names: tuple[str, ...], services: Registry, stack: Stack
    ) -> None:
        """
        Args:
            names: of the services, in the order of the stack file.
        """
        self.recorded: list[Told] = []
        self._source, self._encoder = source, Encoder(source, stack)
        self._host = VirtualHost()
        self._below = MemoryBusPort(self._host.hub("drone"))
        self._own: set[str] = set()  # keys that the services publish
        above = MemoryBusPort(self._host.hub("topside"))
        # A message that crosses the link is heard on both, and counts once.
        self.outputs = Outputs([above, self._below], self._own.__contains__)
        # Where several services are due at one instant, they have their turns in this order.
        self._host.add(GATEWAY, services[GATEWAY], stack)
        self._host.node(RECORDER, ["drone"])  # its health crosses the link and is not recorded
        self._before = self._player("before")
        for name in names:
            node = self._host.node(name, services[name].sides, gateway=services[name].gateway)
            services.wire(name)(node, stack)
            self._own.update(topic.key for topic in node.published)
        self._after = self._player("after")
        order = list(services)
        self._behind = set(order[order.index(names[-1]) + 1 :])
        self._topside = {n for n, who in source.processes.items() if who.side == "topside"}

    def run(self, until_ns: int) -> None:
        """Replay up to `until_ns` [ns], which is included.

        Raises:
            LindyError: the link lost messages on their way down.
        """
        above: list[Raw] = []
        below: list[Raw] = []
        lost, unreadable = _Gaps(), self._source.recording.unreadable
        for raw in self._source.raw(until_ns=until_ns):
            own, side = raw.key in self._own, self._sent_from(raw.key)
            if own or side == "topside":
                told = told_of(raw, 0, unreadable)
                if told is not None and own:
                    self.recorded.append(told)
                elif told is not None:
                    above.append(raw)
                    lost.see(raw.key, told.seq)
            elif side == "drone":
                below.append(raw)
        if lost.count:
            raise LindyError(
                f"{self._source.path}: {lost.count} messages were lost on their way down, are not "
                f"in the recording made on board, and were heard topside; allowed is a dive over a "
                f"link without loss, such as perfect or tether"
            )
        above.sort(key=lambda raw: raw.publish_ns)
        self._before.play(raw for raw in above if not self._is_later(raw.key))
        self._after.play(raw for raw in above if self._is_later(raw.key))
        self._feed(below, until_ns)

    def _feed(self, below: list[Raw], until_ns: int) -> None:
        """Publish on the drone's bus what came from the drone, at its time."""
        host, k = self._host, 0
        while k < len(below):
            at = below[k].log_ns
            if at > host.now:
                host.run(at - 1)
                host.now = at
            while k < len(below) and below[k].log_ns <= at:
                if (envelope := self._encoder.envelope(below[k])) is not None:
                    self._below.forward(envelope)
                k += 1
            host.settle()
        host.run(until_ns)

    def _player(self, name: str) -> "_Player":
        host = self._host
        player = _Player(name, host.hub("topside"), lambda: host.now, self._encoder)
        host.nodes[name] = player.node
        return player

    def _is_later(self, key: str) -> bool:
        """Is it of a service that has its turn after those that are replayed?"""
        return (PUBLISHER.get(key) or key.rpartition("/")[2]) in self._behind

    def _sent_from(self, key: str) -> str | None:
        """The side from which a recorded message came; None: it is of no use here."""
        topic = topics.find(key)
        if (
            topic is None
            or topic.way is Direction.STAY
            or topic in (topics.LINK, topics.LINK_ANSWER)
        ):
            return None  # the link that is run again says its own
        if topic.way is Direction.DOWN:
            return "topside"
        if topic.way is Direction.UP:
            return "drone"
        who = key.rpartition("/")[2]
        if who == GATEWAY:
            return None
        return "topside" if who in self._topside or who == "topside" else "drone"


class _SilentPort(MemoryBusPort):
    """Forwards, and says nothing of its own: the node's health is nobody's."""

    def say(self, topic: AnyTopic) -> Callable[[bytes], None]:  # noqa: ARG002
        return lambda _: None


class _Player:
    """A node that publishes recorded messages topside, each when it was stamped."""

    def __init__(
        self, name: str, hub: MemoryBus, clock: Callable[[], int], encoder: Encoder
    ) -> None:
        self._port, self._encoder = _SilentPort(hub), encoder
        self.node = Node(name, {"topside": self._port}, clock, VolatileCheckpoint())
        self._rows: deque[Raw] = deque()
        self._due = self.node.alarm(self._publish)

    def play(self, rows: Iterable[Raw]) -> None:
        """
        Args:
            rows: in the order of their stamps.
        """
        self._rows.extend(rows)
        self._next()

    def _publish(self, now: int) -> None:
        while self._rows and self._rows[0].publish_ns <= now:
            if (envelope := self._encoder.envelope(self._rows.popleft())) is not None:
                self._port.forward(envelope)
        self._next()

    def _next(self) -> None:
        self._due.set(self._rows[0].publish_ns if self._rows else None)


class _Gaps:
    """Counts gaps in the sequence numbers."""

    def __init__(self) -> None:
        self.count = 0
        self._newest: dict[str, int] = {}

    def see(self, key: str, seq: int) -> None:
        if key in self._newest and seq > self._newest[key] + 1:
            self.count += seq - self._newest[key] - 1
        self._newest[key] = max(seq, self._newest.get(key, 0))
