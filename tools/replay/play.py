"""`lindy replay FILE`: a recorded dive onto a bus, in its own time.

A recorded message becomes one that can be shown now, and that nothing obeys. Its stamps are moved
by one amount, so that it is as old when it is sent as it was when it was recorded. Its encoding
says that it is a replay: no port of a live dive takes it.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from tempfile import TemporaryDirectory

import msgspec

from messages import topics
from messages.text import harmless
from services.runtime.bus.envelope import Bus, Envelope
from services.runtime.bus.zenoh_bus import listening, open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import REPLAY
from services.runtime.hosts.process_host import Launch
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.process_plan import PYTHON
from services.runtime.node.clock_offset import mover
from services.runtime.os import system
from tools.live.cockpit import VIEWER
from tools.live.stop_signals import StopSignals
from tools.log.cut import is_chosen
from tools.recordings.dive_file import flown_stack
from tools.recordings.recording import Raw, Recording
from tools.replay.source import ReplaySource
from tools.text_table import counted

LOOK_S = 0.05  # [s] between two looks at signals
END_S = 5.0  # [s] in which the viewer ends when asked to
BEHIND_NS = 250_000_000  # [ns] later than this, the replay goes on from where it is
CLEAR = "\r\x1b[K"  # the whole line of a terminal
DISPLAYS = {"DISPLAY", "WAYLAND_DISPLAY"}
Send = Callable[[Envelope], None]


def onto_bus(
    source: ReplaySource,
    span: tuple[int, int],
    *,
    speed: float = 1.0,
    patterns: Sequence[str] = (),
    listen: str | None = None,
    headless: bool = False,
) -> int:
    """Play until the end or Ctrl-C. Returns the exit status. Arguments as of `Replay`.

    Args:
        listen: endpoint of the hub for other programs.
        headless: without a viewer.

    Raises:
        LindyError: nothing can be played.
    """
    with ExitStack() as exits:
        stop = exits.enter_context(StopSignals())
        folder = exits.enter_context(TemporaryDirectory(prefix="lindy-"))
        endpoint = listen or f"unixsock-stream/{folder}/hub.sock"
        exits.enter_context(listening(endpoint))
        bus = exits.enter_context(open_bus(endpoint, f"{REPLAY}/{source.vehicle}"))
        if not headless and DISPLAYS & os.environ.keys() and find_spec("rerun"):
            exits.enter_context(viewer(source, endpoint))
        return Replay(source, span, bus, speed, patterns).play(lambda: stop.asked)


class Replay:
    """One replay onto a bus."""

    def __init__(
        self,
        source: ReplaySource,
        span: tuple[int, int],
        bus: Bus,
        speed: float = 1.0,
        patterns: Sequence[str] = (),
    ) -> None:
        """
        Args:
            span: [ns UTC] recorded, both included.
            speed: recorded seconds per second.
            patterns: of keys; none: all.
        """
        self._source, self._speed = source, speed
        begin, self._end = span
        self._out = Republisher(source.recording, bus.forward)
        self._behind = 0  # times that it was too slow
        rows = source.raw(lambda key: is_chosen(key, patterns))
        self._rows = (raw for raw in rows if begin <= raw.log_ns <= self._end)
        self._next = next(self._rows, None)
        self._at, self._since = begin, 0  # [ns] a recorded time, and when it was played

    def play(self, stopped: Callable[[], bool]) -> int:
        """
        Args:
            stopped: does the user want it to end?

        Raises:
            LindyError: there is nothing to play.
        """
        if self._next is None:
            raise LindyError(f"{self._source.path}: nothing of what is asked for is in it")
        what = f"{self._source.vehicle}, {(self._end - self._at) / 1e9:.1f} s at ×{self._speed:g}"
        print(harmless(f"replay of {self._source.path}: {what}"), flush=True)
        self._since, shows = time.monotonic_ns(), sys.stdout.isatty()
        first = self._source.origin_ns
        while not stopped():
            now = time.monotonic_ns()
            if self._sent_all(now) and self._position(now) >= self._end:
                break
            if shows:
                here, end = ((ns - first) / 1e9 for ns in (self._position(now), self._end))
                status = f"{here:8.1f} / {end:.1f} s  ×{self._speed:g}"
                print(f"{CLEAR}{status}", end="", flush=True)
            time.sleep(self._idle_s())
        if shows:
            print(flush=True)
        behind = f"; it was too slow {self._behind} times" if self._behind else ""
        unread = sum(self._source.recording.unreadable.values())
        lost = f"; {counted(unread, 'message')} could not be read" if unread else ""
        sent = f"{counted(self._out.sent, 'message')} of {counted(len(self._out.keys), 'topic')}"
        print(harmless(f"{sent}{lost}{behind}"), flush=True)
        return 0

    def _position(self, now: int) -> int:
        """[ns] Recorded time, at most the end."""
        return min(self._end, self._at + round((now - self._since) * self._speed))

    def _due(self, recorded: int) -> int:
        """[ns] When a recorded time is reached, so that a message's age is as it was."""
        return self._since + round((recorded - self._at) / self._speed)

    def _sent_all(self, now: int) -> bool:
        """Send what is due."""
        row = self._next
        if row is not None and now - self._due(row.log_ns) > BEHIND_NS:
            self._behind += 1
            self._at, self._since = row.log_ns, now
        position = self._position(now)
        while row is not None and row.log_ns <= position:
            self._out.send(row, self._due(row.log_ns))
            row = next(self._rows, None)
        self._next = row
        return row is None

    def _idle_s(self) -> float:
        if self._next is None:
            return LOOK_S
        return max(0.0, min(LOOK_S, (self._due(self._next.log_ns) - time.monotonic_ns()) / 1e9))


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
        payload = msgspec.msgpack.encode(message)
        self._send(Envelope(raw.key, payload, topic.replayed))
        self.sent += 1
        self.keys.add(raw.key)


def one_bus(spec: ServiceSpec) -> ServiceSpec:
    """A replay has one bus, that of the recorder: a service is there once, at home."""
    return msgspec.structs.replace(spec, sides=spec.sides[:1])


@contextmanager
def viewer(source: ReplaySource, endpoint: str) -> Generator[None]:
    """The viewer of a replay: the visualizer as a process of its own, on the replay's keys."""
    services = Registry.read()
    spec = one_bus(services[VIEWER])
    with flown_stack(source.recording) as (stack, copies):
        launch = Launch(
            process=VIEWER,
            services={VIEWER: spec},
            stack=msgspec.structs.replace(stack, replay=True, viewer=True),
            stack_file=str(services.file),
            endpoints={spec.sides[0]: endpoint},
            checkpoint=stack.out,
            supervised=True,
            copies=copies,
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
