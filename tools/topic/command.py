"""`lindy topic` and `lindy top`: the streams of the topic table, and what they and the services do
in a running dive."""

import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Annotated

import msgspec
from cyclopts import App, Parameter

from messages import topics
from messages.events import troubles
from messages.health import LATE_MS, Health
from messages.link import Clock
from messages.message import Message
from messages.text import harmless
from messages.topic import AnyTopic
from messages.units import Ns
from services.runtime.node.clock_offset import ClockOffset
from tools.ask import dive_in
from tools.choices import RunningDive, UntilCtrlC, Whole
from tools.text_table import aligned
from tools.topic.listening import listen, named, side_of

KEPT = 1000
# Pause and age are medians, bytes a mean.
HEADINGS = (
    "messages", "1/s", "table", "pause ms", "longest", "age ms", "p99", "most", "kbit/s", "bytes",
    "largest",
)  # fmt: skip
UNKNOWN = "–"
SILENT_NS = 3_000_000_000  # [ns] of a message that comes once a second
HEALTH_HEADING = (
    *("service", "side", "process", "processor %", "memory MB", "calls 1/s"),
    *("late p50 ms", "late p99 ms", "sent", "received", "counted", ""),
)
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


def top(*, seconds: UntilCtrlC = None, dive: RunningDive = None) -> int:
    """Show what each service costs, and how late it is.

    From the health that each service says once a second. `counted` is all that was dropped, stale,
    refused or limited in its last second; the memory is that of its process, which services with
    the same number share. On a terminal every second, else once at the end.

    Example: lindy top --seconds 10
    """
    running = dive_in(dive)
    heard = dict[str, tuple[Health, Health | None, Ns]]()

    def take(_key: str, health: Message, _size: int, now: Ns) -> None:
        assert isinstance(health, Health)
        before = heard.get(health.service, (None, None, 0))[0]
        same = before is not None and before.instance == health.instance
        heard[health.service] = (health, before if same else None, now)

    def draw() -> list[str]:
        return table(heard, time.monotonic_ns())

    side = side_of(running, [topics.HEALTH])
    listen(running, side, [topics.HEALTH], take, draw, count=None, seconds=seconds)
    return 0


def table(heard: Mapping[str, tuple[Health, Health | None, Ns]], now: Ns) -> list[str]:
    """A line for each service, the dearest first.

    Args:
        heard: by service: its newest health, the one before it of the same process, and when [ns]
            the newest came.
    """
    ranked = sorted(heard.items(), key=lambda each: (-(each[1][0].cpu_percent or 0.0), each[0]))
    return aligned([HEALTH_HEADING, *(_line(*health, now) for _, health in ranked)])


def _line(health: Health, before: Health | None, at: Ns, now: Ns) -> tuple[str, ...]:
    silent, late = now - at > SILENT_NS, (health.lateness_p99_ms or 0.0) > LATE_MS
    remark = f"silent for {(now - at) / 1e9:.0f} s" if silent else "late" if late else ""
    counted = None if before is None else troubles(health.counts) - troubles(before.counts)
    return (
        *(health.service, health.side or UNKNOWN, str(health.pid)),
        *(_number(health.cpu_percent), _number(health.rss_mb), _number(health.loop_hz)),
        *(_number(health.lateness_p50_ms), _number(health.lateness_p99_ms)),
        *(str(health.sent), str(health.received)),
        *(UNKNOWN if counted is None else str(counted), remark),
    )


# How often a stream comes, how old it is, how much of it there is. Intervals and ages are those of
# the newest `KEPT` messages; rates are over the whole time.


@dataclass(slots=True)
class HeardStream:
    """Of one key, since its first message."""

    messages: int = 0
    size: int = 0  # [bytes] of all payloads
    largest: int = 0  # [bytes]
    first_ns: Ns = 0
    newest_ns: Ns = 0
    gaps: deque[Ns] = field(default_factory=lambda: deque[Ns](maxlen=KEPT))
    ages: deque[Ns] = field(default_factory=lambda: deque[Ns](maxlen=KEPT))

    def hear(self, size: int, age: Ns | None, now: Ns) -> None:
        """
        Args:
            size: [bytes] of the payload.
            age: [ns] since the sender's stamp; None: its clock is not known here.
        """
        if self.messages:
            self.gaps.append(now - self.newest_ns)
        else:
            self.first_ns = now
        self.messages, self.newest_ns = self.messages + 1, now
        self.size, self.largest = self.size + size, max(self.largest, size)
        if age is not None:
            self.ages.append(age)

    @property
    def hz(self) -> float | None:
        """[1/s] None: fewer than two messages."""
        span = self.newest_ns - self.first_ns
        return (self.messages - 1) * 1e9 / span if span > 0 else None

    def cells(self, topic: AnyTopic) -> tuple[str, ...]:
        """As `HEADINGS` has them."""
        table = f"{topic.hz:g}" if topic.hz else "events"
        mean = self.size / self.messages if self.messages else None
        kbits = None if self.hz is None or mean is None else self.hz * mean * 8e-3
        largest = float(self.largest) if self.messages else None
        return (
            *(str(self.messages), _number(self.hz), table),
            *_spread(self.gaps, 0.5, 1.0),
            *_spread(self.ages, 0.5, 0.99, 1.0),
            *(_number(kbits), _number(mean, 0), _number(largest, 0)),
        )


def _spread(values: Sequence[Ns], *shares: float) -> tuple[str, ...]:
    """[ms] The least, the most and what is in between; the median is that of two in the middle."""
    if not values:
        return (UNKNOWN,) * len(shares)
    ranked = sorted(values)
    found = [
        median(ranked) if share == 0.5 else ranked[min(len(ranked) - 1, int(share * len(ranked)))]
        for share in shares
    ]
    return tuple(f"{value / 1e6:.1f}" for value in found)


def _number(value: float | None, digits: int = 1) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
