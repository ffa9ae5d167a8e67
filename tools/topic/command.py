"""`lindy topic`: the streams of the topic table, and what they do in a running dive."""

from dataclasses import dataclass
from typing import Annotated

import msgspec
from cyclopts import App, Parameter

from messages import topics
from messages.link import Clock
from messages.message import Message
from messages.text import harmless
from messages.topic import AnyTopic
from messages.units import Ns
from services.runtime.node.clock_offset import ClockOffset
from tools.choices import RunningDive, UntilCtrlC, Whole
from tools.text_table import aligned
from tools.topic.figures import HEADINGS, HeardStream

Key = Annotated[str, Parameter(help="such as state or health/*; default: all of that side")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ListenOptions:
    """Options of what listens to streams."""

    count: Annotated[Whole | None, Parameter(help="end after so many messages")] = None
    seconds: UntilCtrlC = None
    dive: RunningDive = None


DEFAULT = ListenOptions()
topic = App(name="topic", help="List the streams of a dive; show, time and weigh them.")


@topic.command(name="list")
def list_() -> int:
    """List every stream: key, message, rate, QoS profile and direction across the link.

    A key that ends in /* is a family, such as health/control. A rate of 0 is of events.

    Example: lindy topic list
    """
    rows = [
        (row.key, row.message.__name__, f"{row.hz:g}", row.qos.value, row.way.value)
        for row in topics.ALL
    ]
    print("\n".join(aligned([("topic", "message", "1/s", "QoS", "way"), *rows])))
    return 0


@topic.command
def echo(key: str, /, *, limits: ListenOptions = DEFAULT) -> int:
    """Print what arrives of a stream, a line of JSON for each message.

    KEY is a topic of the table, or one of a family: log/* or log/control.

    Example: lindy topic echo vehicle/status --count 1
    """
    from tools.ask import dive_in
    from tools.topic.listening import listen, named, side_of

    wanted = named([key])
    running = dive_in(limits.dive)

    def take(key: str, message: Message, _size: int, _at: Ns) -> None:
        line = msgspec.json.encode({"topic": key, "message": message}).decode()
        print(harmless(line), flush=True)

    here = side_of(running, wanted)
    listen(running, here, wanted, take, None, count=limits.count, seconds=limits.seconds)
    return 0


@topic.command
def hz(*keys: Key, limits: ListenOptions = DEFAULT) -> int:
    """Print how often streams come, how old they are and how much they weigh.

    Beside the rate of the table: the pauses between messages, their age since the stamp of whoever
    sent them, and the payload without Zenoh's own bytes. Between two computers the drone's clock is
    that of link/clock; of streams that both sides send the age is then not known. On a terminal
    every second, else once at the end.

    Example: lindy topic hz state pilot/command camera/video --seconds 5
    """
    from tools.ask import dive_in
    from tools.topic.listening import listen, named, side_of

    asked = named(keys)
    running = dive_in(limits.dive)
    here = side_of(running, asked)
    clock = ClockOffset(here) if len(running.endpoints) == 1 else None  # else there is one clock
    found = {each.key: HeardStream() for each in asked if not each.is_family}

    def take(key: str, message: Message, size: int, at: Ns) -> None:
        if clock is not None and isinstance(message, Clock):
            clock.learn(message, at)
        stamp = message.stamp_ns
        local = stamp if clock is None else clock.local_ns(_row(key), stamp)
        found.setdefault(key, HeardStream()).hear(size, None if local is None else at - local, at)

    def draw() -> list[str]:
        heard = sorted((key, figures) for key, figures in found.items())
        cells = [(key, *figures.cells(_row(key))) for key, figures in heard]
        return aligned([("topic", *HEADINGS), *cells])

    also = [] if clock is None else [topics.CLOCK]
    wanted = [*(asked or topics.ALL), *also]
    listen(running, here, wanted, take, draw, count=limits.count, seconds=limits.seconds)
    return 0


def _row(key: str) -> AnyTopic:
    row = topics.find(key)
    assert row is not None, key
    return row
