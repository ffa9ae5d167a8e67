"""What a replay needs to know of a recording before its first message."""

import re
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import NamedTuple

from messages import topics
from messages.events import MALFORMED, row_of
from messages.health import Health
from messages.identity import SideIdentity
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import messages_hash
from services.runtime.config.stack import Stack
from tools.recordings.dive_file import flown_stack
from tools.recordings.recording import Raw, Recording, always, open_recording

BACKWARDS_S = 0.01  # [s] less is no matter
DAY_NS = 86_400_000_000_000  # [ns]
LONGEST_NS = 31 * DAY_NS  # [ns] of a recording: with a wrong time it would be walked through
CUT = "cut"  # metadata: it is a part of another recording
IMPORTED = "imported"  # in the metadata `dive`: the log that it was made of
FLOWN = (topics.HEALTH, topics.STATUS, topics.IDENTITY)  # what says how a dive was flown
THINNED = "thinned"  # metadata: messages were taken out on purpose


class Process(NamedTuple):
    """A service as its first health message shows it."""

    side: str
    started_ns: int  # [ns] UTC; health is reported every second from then on
    instance: int
    pid: int


class ReplaySource:
    """A recording of Lindy.

    Attributes:
        vehicle: its name as in keys.
        utc_offset_ns: [ns] UTC minus the clock of stamps on board; 0: virtual time.
        span: [ns] UTC of the first and the last message.
        goes_back_ns: [ns] the farthest that a message is before an earlier one.
        processes: the services that reported their health, by name.
        named_start_ns: [ns] when `reference` was started, by the clock on board: the first epoch it
            grants says so to the microsecond. None: nothing was granted.
        identity: what the drone said of itself first; else any side; None: nobody said anything.
    """

    def __init__(self, path: Path, recording: Recording, vehicle: str, utc_offset_ns: int) -> None:
        """
        Raises:
            LindyError: there is no message in it, or some have a wrong time.
        """
        self.path, self.recording, self.vehicle = path, recording, vehicle
        self.utc_offset_ns = utc_offset_ns
        self.about = recording.metadata("dive")
        self.processes: dict[str, Process] = {}
        self.named_start_ns: int | None = None
        self.identity: SideIdentity | None = None
        first, last, self.goes_back_ns = inf, 0, 0
        says: dict[str, bool] = {}  # by key: something of how the dive was flown
        for raw in recording.raw():
            key, _, at, *_ = raw
            if at >= last:
                last = at
            elif last - at > self.goes_back_ns:
                self.goes_back_ns = last - at
            if at < first:
                first = at
            if key not in says:
                says[key] = any(topic.covers(key) for topic in FLOWN)
            if says[key]:
                self._see(raw)
        recording.unreadable.clear()  # they are counted as they are used
        if first == inf:
            raise LindyError(f"{path} holds no message that can be read: nothing to replay")
        if last - first > LONGEST_NS:
            days = LONGEST_NS // DAY_NS
            raise LindyError(
                f"{path}: its messages are {(last - first) / DAY_NS:.0f} days apart, allowed "
                f"are {days}: some have a wrong time"
            )
        self.span = int(first), last

    def _see(self, raw: Raw) -> None:
        if topics.HEALTH.covers(raw.key):
            service = raw.key.removeprefix("health/")
            if service not in self.processes:
                health = self.recording.decode(raw)
                if isinstance(health, Health):
                    reports = health.seq + 1  # the first one comes a period after the start
                    started = raw.publish_ns - round(reports * 1e9 / topics.HEALTH.hz)
                    process = Process(health.side, started, health.instance, health.pid)
                    self.processes[service] = process
        elif raw.key == topics.STATUS.key and self.named_start_ns is None:
            status = self.recording.decode(raw)
            if isinstance(status, VehicleStatus) and status.epoch:
                self.named_start_ns = (status.epoch - 1) * 1000
        elif topics.IDENTITY.covers(raw.key):
            said = self.recording.decode(raw)
            if isinstance(said, SideIdentity):
                known = self.identity
                if known is None or (said.side == "drone" and known.side != "drone"):
                    self.identity = said

    @property
    def virtual(self) -> bool:
        """Was it made on virtual time?"""
        return self.utc_offset_ns == 0

    @property
    def thinned(self) -> bool:
        return bool(self.recording.metadata(THINNED))

    @property
    def cut(self) -> bool:
        """Is it a part of another recording?"""
        return bool(self.recording.metadata(CUT))

    @property
    def imported(self) -> bool:
        """Is it of a log that another program wrote? Then none of our services ran in that dive."""
        return IMPORTED in self.about

    @property
    def damaged(self) -> int:
        """How many messages arrived on board that nobody could read."""
        lost = self.recording.losses()
        return sum(n for name, n in lost.items() if row_of(name) is MALFORMED)

    def raw(self, wants: Callable[[str], bool] = always, until_ns: float = inf) -> Iterator[Raw]:
        """Every message that arrived by `until_ns` [ns] UTC."""
        within = (-inf, until_ns + 1)
        return (raw for raw in self.recording.raw(wants, within=within) if raw.log_ns <= until_ns)

    @property
    def origin_ns(self) -> int:
        """[ns] UTC from which its seconds count: its first message, or, where it was cut out of
        another recording, that of the whole."""
        whole = self.recording.origin_ns() if self.cut else None
        return self.span[0] if whole is None else whole

    @property
    def other_messages(self) -> str:
        """The hash of the messages it was made with, if they are not today's; empty: they are, or
        nobody knows."""
        said = "" if self.identity is None else self.identity.messages
        return "" if said == messages_hash(topics.ALL) else said

    @property
    def apart(self) -> bool:
        """Were topside and drone two machines? Then the link monitor ran on each."""
        return "link_monitor_drone" in self.processes

    @contextmanager
    def stack(self) -> Generator[Stack]:
        """The settings of that dive, from the files that are in the recording.

        Raises:
            LindyError: as `flown_stack`.
        """
        with flown_stack(self.recording, virtual=self.virtual, apart=self.apart) as (stack, _):
            yield stack


def open_source(path: Path) -> ReplaySource:
    """
    Raises:
        LindyError: no such file, not a recording of Lindy, or nothing in it.
    """
    recording = open_recording(path)
    if not any(file.stat().st_size for file in recording.files):
        raise LindyError(f"{path} is empty: there is nothing to replay")
    vehicle = recording.metadata("dive").get("vehicle", "")
    if not re.fullmatch(r"[a-z0-9_]+", vehicle):
        raise LindyError(
            f"{path} is not a recording of Lindy, or is cut off before it says of which vehicle: "
            f"allowed is a dive's folder or its dive.mcap"
        )
    offset = recording.metadata("clock").get("utc_minus_stamp_ns", "0")
    try:
        utc_offset_ns = int(offset)
    except ValueError:
        raise LindyError(f"{path}: its clock is {offset!r}, expected whole nanoseconds") from None
    return ReplaySource(path, recording, vehicle, utc_offset_ns)


def remarks(source: ReplaySource) -> list[str]:
    """What a reader should know of this recording before he trusts a result."""
    said = source.recording.damage
    if (seconds := source.goes_back_ns / 1e9) > BACKWARDS_S:
        said.append(
            f"its clock runs backwards by {seconds:.1f} s: what it holds from then on has other "
            f"times than it had in the dive"
        )
    if theirs := source.other_messages:
        said.append(
            f"it was made with other messages (hash {theirs}, today's is "
            f"{messages_hash(topics.ALL)}): fields that only one of them has are not compared"
        )
    return said
