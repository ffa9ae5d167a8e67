"""Hears streams of a running dive until something ends it."""

import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Collection
from contextlib import ExitStack

from rich.text import Text

from messages import topics
from messages.message import Message
from messages.payload import PayloadDecoder
from messages.text import harmless
from messages.topic import AnyTopic, Direction, Side
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.config.settings import nearest
from services.runtime.launch.process_plan import HOME
from tools.live.screen import drawn_anew
from tools.live.stop_signals import StopSignals

STEP_S = 0.05  # [s] between two looks at what has arrived
QUIET_S = 3.0  # [s] without any message, after which that is said
SHOW_S = 1.0  # [s] between two pictures on a terminal
WAITING = 100_000  # messages between two looks

Take = Callable[[str, Message, int, int], None]  # key, message, [bytes] its size, [ns] arrival
Draw = Callable[[], list[str]]


def named(keys: Collection[str]) -> list[AnyTopic]:
    """Topics of the table by their keys: of a family all (`health/*`) or one (`health/control`).

    Raises:
        LindyError: there is no such topic.
    """
    found = list[AnyTopic]()
    for key in keys:
        family = next((topic for topic in topics.ALL if topic.key == key), None)
        topic = family or topics.find(key)
        if topic is None:
            known = nearest(key, [topic.key for topic in topics.ALL])
            raise LindyError(f"no topic is called {key!r}{known}; `lindy topic list` has them all")
        found.append(topic if topic is family else topic.of(key.rpartition("/")[2]))
    return found


def side_of(running: Running, wanted: Collection[AnyTopic]) -> Side:
    """Where to listen: at the pilot's side, unless some of what is wanted never leaves the drone.

    Args:
        wanted: by name; empty: all that is heard there.

    Raises:
        LindyError: that side is not on this machine.
    """
    stays = [topic.key for topic in wanted if topic.way is Direction.STAY]
    side: Side = "drone" if stays or HOME not in running.endpoints else HOME
    if side not in running.endpoints:
        raise LindyError(
            f"{stays[0]} never leaves the drone; on this machine is only the "
            f"{', '.join(running.endpoints)}"
        )
    return side


def listen(
    running: Running,
    side: Side,
    wanted: Collection[AnyTopic],
    take: Take,
    draw: Draw | None,
    *,
    count: int | None,
    seconds: float | None,
) -> None:
    """
    Args:
        take: is given what arrives, in its order, but what cannot be read: anybody may send it.
        draw: lines to be shown: on a terminal every second, else once at the end; None: none.
        count: messages after which it ends; what cannot be read is none.
        seconds: [s] after which it ends.

    Raises:
        LindyError: a limit is no positive number, the dive has ended, or, at the end, there were
            messages that could not be read.
    """
    for name, limit in (("count", count), ("seconds", seconds)):
        if limit is not None and not 0 < limit < float("inf"):
            raise LindyError(f"--{name} is {limit:g}, expected a number above 0")
    waiting = deque[tuple[Envelope, int]](maxlen=WAITING)  # filled on Zenoh's thread
    heard, show_at, most = 0, 0.0, float("inf") if count is None else count
    reader = _Reader()
    with (
        ExitStack() as exits,
        StopSignals() as stop,
        open_bus(running.endpoints[side], running.vehicle) as bus,
    ):
        show = exits.enter_context(drawn_anew()) if draw and sys.stdout.isatty() else None
        for topic in {topic.key: topic for topic in wanted}.values():
            bus.hear(topic.key, lambda e: waiting.append((e, time.monotonic_ns())))
        begun = time.monotonic()
        end, quiet_at = begun + (float("inf") if seconds is None else seconds), begun + QUIET_S
        while not stop.asked and time.monotonic() < end and heard < most:
            time.sleep(STEP_S)  # messages come on Zenoh's thread; nothing here is in a hurry
            while waiting and heard < most:
                envelope, at = waiting.popleft()
                if (message := reader.read(envelope)) is not None:
                    heard += 1
                    take(envelope.key, message, len(envelope.payload), at)
            if draw is None and not heard and time.monotonic() >= quiet_at:
                quiet_at, keys = float("inf"), ", ".join(topic.key for topic in wanted)
                print(f"nothing has arrived on {keys} yet", file=sys.stderr, flush=True)
            if show is not None and draw is not None and time.monotonic() >= show_at:
                show_at = time.monotonic() + SHOW_S
                lines = draw()
                show(lambda size, lines=lines: _fitting(lines, size.height))
    if draw is not None:
        print("\n".join(draw()), flush=True)
    reader.complain()


class _Reader:
    """Reads what arrives: anybody may have sent it."""

    def __init__(self) -> None:
        self._decoders = {topic.key: PayloadDecoder(topic) for topic in topics.ALL}
        self._unread = Counter[str]()

    def read(self, envelope: Envelope) -> Message | None:
        """None: it could not be, and is counted."""
        key, row = envelope.key, topics.find(envelope.key)
        if row is not None:
            message = self._decoders[row.key].read(key, envelope.encoding, envelope.payload)
            if isinstance(message, Message):
                return message
        self._unread[key] += 1
        return None

    def complain(self) -> None:
        """Raises LindyError: some could not be read."""
        each = [f"{count} messages on {key}" for key, count in self._unread.most_common(5)]
        if each:
            raise LindyError(f"{harmless(', '.join(each))} could not be read")


def _fitting(lines: list[str], height: int) -> Text:
    fit = lines[: max(1, height - 1)]
    if hidden := len(lines) - len(fit):
        fit[-1] = f"and {hidden + 1} more: the window is too low"
    return Text("\n".join(fit), no_wrap=True, overflow="ellipsis")
