"""What a replay needs to know of a recording before its first message."""

import re
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
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
THINNED = "thinned"  # metadata: messages were taken out on purpose


class Process(NamedTuple):
    """A service as its first health message shows it."""

    side: str
    started_ns: int  # [ns] UTC; health is reported every second from then on
    instance: int
    pid: int


@dataclass
class ReplaySource:
    """A recording of Lindy."""

    path: Path
    recording: Recording
    vehicle: str  # as in keys
    about: dict[str, str]
    utc_offset_ns: int  # [ns] UTC minus the clock of stamps on board; 0: virtual time
    _goes_back_ns: int = 0  # likewise: the farthest that a message is before an earlier one

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

    @cached_property
    def span(self) -> tuple[int, int]:
        """[ns] UTC of the first and the last message.

        Raises:
            LindyError: there is none, or some have a wrong time.
        """
        first: int | None = None
        last = 0
        for raw in self.recording.raw():
            first = raw.log_ns if first is None else min(first, raw.log_ns)
            self._goes_back_ns = max(self._goes_back_ns, last - raw.log_ns)
            last = max(last, raw.log_ns)
        if first is None:
            raise LindyError(f"{self.path} holds no message that can be read: nothing to replay")
        if last - first > LONGEST_NS:
            days = LONGEST_NS // DAY_NS
            raise LindyError(
                f"{self.path}: its messages are {(last - first) / DAY_NS:.0f} days apart, allowed "
                f"are {days}: some have a wrong time"
            )
        return first, last

    @cached_property
    def origin_ns(self) -> int:
        """[ns] UTC from which its seconds count: its first message, or, where it was cut out of
        another recording, that of the whole.

        Raises:
            LindyError: as `span`.
        """
        first, _ = self.span
        whole = self.recording.origin_ns() if self.cut else None
        return first if whole is None else whole

    @property
    def goes_back_s(self) -> float:
        """[s] How far its clock ran backwards.

        Raises:
            LindyError: as `span`.
        """
        _ = self.span
        return self._goes_back_ns / 1e9

    @property
    def damage(self) -> list[str]:
        """What cannot be read in it, or may be missing at its end, one sentence each.

        Raises:
            LindyError: as `span`.
        """
        _ = self.span
        return self.recording.damage

    @cached_property
    def processes(self) -> dict[str, Process]:
        """The services that reported their health, by name."""
        found: dict[str, Process] = {}
        for key, health, _, publish_ns in self.recording.of(topics.HEALTH):
            service = key.removeprefix("health/")
            if service not in found and isinstance(health, Health):
                reports = health.seq + 1  # the first one comes a period after the start
                started = publish_ns - round(reports * 1e9 / topics.HEALTH.hz)
                found[service] = Process(health.side, started, health.instance, health.pid)
        return found

    @cached_property
    def named_start_ns(self) -> int | None:
        """[ns] When `reference` was started, by the clock on board: the first epoch it grants says
        so to the microsecond. None: nothing was granted."""
        for _, status, *_ in self.recording.of(topics.STATUS):
            if isinstance(status, VehicleStatus) and status.epoch:
                return (status.epoch - 1) * 1000
        return None

    @cached_property
    def identity(self) -> SideIdentity | None:
        """What the drone said of itself first; else any side; None: nobody said anything."""
        found: SideIdentity | None = None
        for _, said, *_ in self.recording.of(topics.IDENTITY):
            if isinstance(said, SideIdentity) and said.side == "drone":
                return said
            if isinstance(said, SideIdentity):
                found = found or said
        return found

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
    about = recording.metadata("dive")
    vehicle = about.get("vehicle", "")
    if not re.fullmatch(r"[a-z0-9_]+", vehicle):
        raise LindyError(
            f"{path} is not a recording of Lindy, or is cut off before it says of which vehicle: "
            f"allowed is a dive's folder or its dive.mcap"
        )
    offset = recording.metadata("clock").get("utc_minus_stamp_ns", "0")
    try:
        return ReplaySource(path, recording, vehicle, about, int(offset))
    except ValueError:
        raise LindyError(f"{path}: its clock is {offset!r}, expected whole nanoseconds") from None


def remarks(source: ReplaySource) -> list[str]:
    """What a reader should know of this recording before he trusts a result."""
    said = source.damage
    if (seconds := source.goes_back_s) > BACKWARDS_S:
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
