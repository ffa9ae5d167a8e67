"""`lindy replay FILE`: a recorded dive onto a bus, in its own time.

A recorded message becomes one that can be shown now, and that nothing obeys. Its stamps are moved
by one amount, so that it is as old when it is sent as it was when it was recorded. Its encoding
says that it is a replay: no port of a live dive takes it.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from messages import topics
from messages.health import LogLine
from messages.message import Message
from messages.text import harmless
from messages.topic import AnyTopic
from services.runtime.bus.envelope import Bus, Envelope
from services.runtime.bus.zenoh_bus import QOS_PROFILES, listening, open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import REPLAY, Stack
from services.runtime.hosts.process_host import Launch
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.process_plan import PYTHON
from services.runtime.node.clock_offset import mover
from services.runtime.os import system
from tools.live.cockpit import VIEWER
from tools.live.stop_signals import StopSignals
from tools.log.topic_patterns import is_chosen
from tools.recordings.recording import Raw, Recording
from tools.replay.source import ReplaySource

LOOK_S = 0.05  # [s] between two looks at signals
HEARD_S = 3.0  # [s] in which a hub hands a message on, if it does at all
END_S = 5.0  # [s] in which the viewer ends when asked to
BEHIND_NS = 250_000_000  # [ns] later than this, the replay goes on from where it is
CLEAR = "\r\x1b[K"  # the whole line of a terminal
DISPLAYS = {"DISPLAY", "WAYLAND_DISPLAY"}
Send = Callable[[Envelope], None]


@dataclass(frozen=True, slots=True)
class Wish:
    """What is to be played, and how."""

    span: tuple[int, int]  # [ns UTC] recorded, both included
    speed: float = 1.0
    loop: bool = False
    patterns: tuple[str, ...] = ()  # of keys; none: all


def onto_bus(
    source: ReplaySource,
    wish: Wish,
    *,
    connect: str | None,
    listen: str | None,
    headless: bool,
) -> int:
    """Play until the end or Ctrl-C. Returns the exit status.

    Raises:
        LindyError: the hub lets no replay through, or nothing can be played.
    """
    space = f"{REPLAY}/{source.vehicle}"
    with ExitStack() as exits:
        stop = exits.enter_context(StopSignals())
        folder = Path(exits.enter_context(TemporaryDirectory(prefix="lindy-")))
        endpoint = connect or listen or f"unixsock-stream/{folder}/hub.sock"
        if connect is None:
            exits.enter_context(listening(endpoint))
        bus = exits.enter_context(open_bus(endpoint, space))
        with open_bus(endpoint, space) as listener:
            require_heard(endpoint, bus, listener, source.path.name)
        if not headless and DISPLAYS & os.environ.keys() and find_spec("rerun"):
            exits.enter_context(viewer(exits.enter_context(source.stack()), endpoint))
        return Replay(source, wish, bus).play(lambda: stop.asked)


class Replay:
    """One replay onto a bus."""

    def __init__(self, source: ReplaySource, wish: Wish, bus: Bus) -> None:
        self._source, self._wish = source, wish
        self._out = Republisher(source.recording, bus.forward)
        self._behind = 0  # times that it was too slow
        self._shows = sys.stdout.isatty()
        self._begin(0)

    def play(self, stopped: Callable[[], bool]) -> int:
        """
        Args:
            stopped: does the user want it to end?

        Raises:
            LindyError: there is nothing to play.
        """
        (begin, end), speed, loop = self._wish.span, self._wish.speed, self._wish.loop
        if self._next is None:
            raise LindyError(f"{self._source.path}: nothing of what is asked for is in it")
        over = ", over and over" if loop else ""
        what = f"{self._source.vehicle}, {(end - begin) / 1e9:.1f} s at ×{speed:g}{over}"
        print(harmless(f"replay of {self._source.path}: {what}"), flush=True)
        self._since = time.monotonic_ns()
        while not stopped():
            now = time.monotonic_ns()
            self._send_due(now)
            if self._is_over(now):
                if not loop:
                    break
                self._begin(now)
            if self._shows:
                print(f"{CLEAR}{self._status(now)}", end="", flush=True)
            time.sleep(self._idle_s(time.monotonic_ns()))
        if self._shows:
            print(flush=True)
        behind = f"; it was too slow {self._behind} times" if self._behind else ""
        unread = sum(self._source.recording.unreadable.values())
        lost = f"; {unread} messages could not be read" if unread else ""
        sent = f"{self._out.sent} messages of {len(self._out.keys)} topics"
        print(harmless(f"{sent}{lost}{behind}"), flush=True)
        return 0

    def _begin(self, now: int) -> None:
        self._at, self._since = self._wish.span[0], now  # [ns] recorded time, and when it was
        self._rows = self._recorded()
        self._next = next(self._rows, None)

    def _recorded(self) -> Iterator[Raw]:
        begin, end = self._wish.span
        rows = self._source.raw(lambda key: is_chosen(key, self._wish.patterns))
        return (raw for raw in rows if begin <= raw.log_ns <= end)

    def _is_over(self, now: int) -> bool:
        return self._next is None and self._position(now) >= self._wish.span[1]

    def _position(self, now: int) -> int:
        """[ns] Recorded time, at most the end."""
        gone = round((now - self._since) * self._wish.speed)
        return min(self._wish.span[1], self._at + gone)

    def _due(self, recorded: int) -> int:
        """[ns] When a recorded time is reached, so that a message's age is as it was."""
        return self._since + round((recorded - self._at) / self._wish.speed)

    def _send_due(self, now: int) -> None:
        row = self._next
        if row is not None and now - self._due(row.log_ns) > BEHIND_NS:
            self._behind += 1
            self._at, self._since = row.log_ns, now
        position = self._position(now)
        while row is not None and row.log_ns <= position:
            self._out.send(row, self._due(row.log_ns))
            row = next(self._rows, None)
        self._next = row

    def _idle_s(self, now: int) -> float:
        if self._next is None:
            return LOOK_S
        return max(0.0, min(LOOK_S, (self._due(self._next.log_ns) - now) / 1e9))

    def _status(self, now: int) -> str:
        first, (_, end) = self._source.origin_ns, self._wish.span
        here = (self._position(now) - first) / 1e9
        return f"{here:8.1f} / {(end - first) / 1e9:.1f} s  ×{self._wish.speed:g}"


class Republisher:
    """Sends recorded messages again.

    Attributes:
        sent: so far.
        keys: that were sent.
    """

    def __init__(self, recording: Recording, send: Send) -> None:
        self.sent = 0
        self.keys: set[str] = set()
        self._recording, self._send = recording, send

    def send(self, raw: Raw, due: int) -> None:
        """
        Args:
            due: [ns] when it is to be sent by the clock of this machine.
        """
        message, topic = self._recording.decode(raw), topics.find(raw.key)
        if message is None or topic is None:
            return  # counted by the recording as unreadable
        stamp = due - (raw.log_ns - raw.publish_ns)
        mover(topic.message)(message, message.stamp_ns - stamp)
        self._send(replayed(raw.key, topic, message))
        self.sent += 1
        self.keys.add(raw.key)


def replayed(key: str, topic: AnyTopic, message: Message) -> Envelope:
    """A message marked as one of a replay."""
    payload = msgspec.msgpack.encode(message)
    return Envelope(key, payload, topic.replayed, travelled=QOS_PROFILES[topic.qos])


def require_heard(endpoint: str, bus: Bus, listener: Bus, name: str) -> None:
    """Say on the bus that a replay begins, until somebody else there hears it.

    Args:
        listener: another connection to the hub at `endpoint`.
        name: of the recording.

    Raises:
        LindyError: the hub hands no replay on. That of a vehicle does not: its access control lets
            nothing through but the vehicle's own keys.
    """
    topic, came = topics.LOG.of("replay"), threading.Event()
    listener.hear(topic.key, lambda _: came.set())
    deadline = time.monotonic() + HEARD_S
    while not came.wait(0.05) and time.monotonic() < deadline:  # a subscription takes a moment
        line = LogLine(
            stamp_ns=time.monotonic_ns(), service="replay", level="info", text=f"replay of {name}"
        )
        bus.forward(replayed(topic.key, topic, line))
    if not came.is_set():
        raise LindyError(
            f"the hub at {endpoint} lets no replay through: it is that of a vehicle; leave out "
            f"--connect, or start one of its own with `lindy hub tcp/127.0.0.1:7449`"
        )


def one_bus(spec: ServiceSpec) -> ServiceSpec:
    """A replay has one bus, that of the recorder: a service is there once, at home."""
    return msgspec.structs.replace(spec, sides=spec.sides[:1])


@contextmanager
def viewer(stack: Stack, endpoint: str) -> Generator[None]:
    """The viewer of a replay: the visualizer as a process of its own, on the replay's keys.

    Args:
        stack: of the recorded dive; the viewer's file is put into its folder.
    """
    services = Registry.read()
    spec = one_bus(services[VIEWER])
    launch = Launch(
        process=VIEWER,
        services={VIEWER: spec},
        stack=msgspec.structs.replace(stack, replay=True, viewer=True, virtual=False),
        stack_file=str(services.file),
        endpoints={spec.sides[0]: endpoint},
        checkpoint=str(Path(stack.out)),
        supervised=True,
    )
    command = [*PYTHON, msgspec.json.encode(launch).decode()]
    child = subprocess.Popen(command, stdin=system.STDIN, **system.APART)
    try:
        yield
    finally:
        system.ask_to_end(child)
        try:
            child.wait(END_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
