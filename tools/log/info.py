"""`lindy log info`: what a recording is of, and what is in it."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from math import inf
from pathlib import Path

import msgspec

from messages import topics
from messages.health import LogLine
from messages.link import Clock
from messages.message import Message
from messages.payload import UNDECODABLE
from messages.text import harmless
from messages.vehicle import OWN_WAY, VehicleStatus
from services.runtime.config.errors import LindyError
from tools.choices import Json
from tools.exit_status import DONE, LOST
from tools.log.cut import ArmedSpan, ArmedSpans
from tools.recordings.dive_file import FlownDive, flown_dive
from tools.recordings.progress import reading
from tools.recordings.recording import Raw, Recording, is_whole, open_recording
from tools.report.summary import lined_up
from tools.text_table import aligned

LOG = topics.LOG.key[:-1]
KEYS = (topics.STATUS.key, topics.CLOCK.key)
REAL_NS = 10**18  # [ns] UTC in 2001: an earlier time is virtual
SHOWN = 12  # events on the screen; all of them are in the JSON
LEVELS = ("warning:", "error:")  # how the lines of a log begin


class TopicInfo(msgspec.Struct, kw_only=True):
    """What is recorded of one topic."""

    type: str = ""
    count: int = 0
    bytes: int = 0  # of the messages, uncompressed
    first_s: float = inf  # [s]
    last_s: float = -inf  # [s]

    @property
    def hz(self) -> float | None:
        """[1/s] Between the first and the last."""
        seconds = self.last_s - self.first_s
        return (self.count - 1) / seconds if self.count > 1 and seconds > 0.0 else None


class SeenEvent(msgspec.Struct):
    """Something that a person wants to know of."""

    t: float  # [s]
    what: str


class Attached(msgspec.Struct):
    name: str
    bytes: int


class Info(msgspec.Struct, kw_only=True):
    files: list[str]
    bytes: int  # of the files
    finished: bool  # all of them
    damage: list[str]  # what cannot be read, or may be missing at the end; empty: nothing
    about: dict[str, str]  # vehicle, link, pilot, seed, overrides
    dive: FlownDive | None  # by which Lindy, from which files
    utc: str | None  # when it began; None: on virtual time
    seconds: float  # [s] from the first message to the last
    armed_seconds: float  # [s] of them
    dives: list[ArmedSpan]  # when it was armed; the first is `--dive 1` of `lindy log cut`
    clock_offset_ms: float | None  # [ms] drone's clock minus topside's, newest
    clock_bound_ms: float | None  # [ms] greatest error of that
    log_hash: str | None
    topics: dict[str, TopicInfo]
    attachments: list[Attached]
    events: list[SeenEvent]


class Gathered:
    """Everything that `info` says of the messages, collected one by one."""

    def __init__(self, origin_ns: int) -> None:
        self.topics: dict[str, TopicInfo] = {}
        self.events: list[SeenEvent] = []
        self.armed = ArmedSpans()
        self.clock: Clock | None = None
        self.origin_ns = origin_ns  # [ns] UTC from which its seconds count
        self._status: VehicleStatus | None = None

    def count(self, raw: Raw) -> None:
        """One more message of its key."""
        if (seen := self.topics.get(raw.key)) is None:
            topic = topics.find(raw.key)
            name = "" if topic is None else topic.message.__name__
            seen = self.topics[raw.key] = TopicInfo(type=name)
        t = (raw.log_ns - self.origin_ns) / 1e9
        seen.count += 1
        seen.bytes += len(raw.data)
        seen.first_s, seen.last_s = min(seen.first_s, t), max(seen.last_s, t)

    def read(self, message: Message, t: float) -> None:
        match message:
            case VehicleStatus():
                self._see_status(message, t)
            case LogLine() if message.level != "info":
                said = f"{message.level}: {message.service}: {message.text}"
                self.events.append(SeenEvent(round(t, 3), said))
            case Clock() if message.offset_ns is not None:
                self.clock = message
            case _:
                pass

    def _see_status(self, status: VehicleStatus, t: float) -> None:
        if not self.armed.see(status, t):
            return
        before, self._status = self._status, status
        if status.armed != (before is not None and before.armed):
            self.events.append(SeenEvent(round(t, 3), "armed" if status.armed else "disarmed"))
        if status.armed and (before is None or status.flight_mode != before.flight_mode):
            self.events.append(SeenEvent(round(t, 3), f"mode {status.flight_mode}"))
        if status.activity in OWN_WAY and (before is None or status.activity != before.activity):
            self.events.append(SeenEvent(round(t, 3), status.activity))
        now = status.failsafe, status.reaction
        if now != (("none", None) if before is None else (before.failsafe, before.reaction)):
            over = "failsafe over" if status.failsafe == "none" else ""
            acts = f"failsafe {status.failsafe}: {status.reaction or 'nothing yet'}"
            self.events.append(SeenEvent(round(t, 3), over or acts))


def info(recording: Path, /, *, json: Json = False) -> int:
    """Print what a recording is of, and what is in it.

    Vehicle, versions, length, events, topics. RECORDING is a dive's folder or its MCAP file. Exit
    status 3: it is damaged or was not finished.

    Example: lindy log info dives/latest
    """
    opened = open_recording(recording)
    with reading("reading", opened.size) as opened.advance:
        found = info_of(opened)
    if not found.topics and not found.about:
        raise LindyError(f"{recording} holds no message that can be read")
    if json:
        print(msgspec.json.format(msgspec.json.encode(found)).decode())
    else:
        print(harmless(as_text(found)))
    return LOST if found.damage else DONE


def info_of(recording: Recording) -> Info:
    origin = recording.origin_ns()
    gathered = Gathered(origin or 0)
    for raw in recording.raw():
        gathered.count(raw)
        read = raw.key in KEYS or raw.key.startswith(LOG)
        if read and (message := recording.decode(raw)) is not None:
            gathered.read(message, (raw.log_ns - gathered.origin_ns) / 1e9)
    damage = recording.damage
    seen = {key: topic for key, topic in sorted(gathered.topics.items()) if topic.count}
    clock = gathered.clock
    last = max((topic.last_s for topic in seen.values()), default=0.0)
    armed = gathered.armed.until(last)
    first = min((topic.first_s for topic in seen.values()), default=0.0)
    attached = {a.name: Attached(a.name, len(a.data)) for a in recording.attachments()}
    began = datetime.fromtimestamp(gathered.origin_ns / 1e9, UTC)
    return Info(
        files=[str(file) for file in recording.files],
        bytes=recording.size,
        finished=all(map(is_whole, recording.files)),
        damage=damage,
        about=recording.metadata("dive"),
        dive=flown_dive(recording),
        utc=f"{began:%Y-%m-%dT%H:%M:%SZ}" if gathered.origin_ns > REAL_NS else None,
        seconds=last - first,
        armed_seconds=sum(span.seconds for span in armed),
        dives=armed,
        clock_offset_ms=None if clock is None else (clock.offset_ns or 0) / 1e6,
        clock_bound_ms=None if clock is None or clock.bound_ns is None else clock.bound_ns / 1e6,
        log_hash=recording.metadata("hash").get("sha256"),
        topics=seen,
        attachments=[*attached.values()],
        events=gathered.events,
    )


def as_text(found: Info) -> str:
    """A few lines, then the dives, the events, and a table of the topics."""
    blocks = [lined_up(_rows(found))]
    if found.dives:
        dives = [
            f"dive {number}: armed {span.words} ({span.seconds:.1f} s)"
            for number, span in enumerate(found.dives, start=1)
        ]
        blocks.append("\n".join(dives))
    if found.events:
        # What the vehicle did comes before what was said of it.
        first = sorted(found.events, key=lambda event: event.what.startswith(LEVELS))[:SHOWN]
        shown = sorted(first, key=lambda event: event.t)
        lines = [f"{event.t:9.2f} s  {event.what}" for event in shown]
        more = len(found.events) - SHOWN
        blocks.append("\n".join(lines + ([f"{'':>11}  and {more} more"] if more > 0 else [])))
    if found.topics:
        blocks.append(_topics(found.topics))
    if found.damage:
        blocks.append("\n".join(found.damage))
    return "\n\n".join(blocks)


def _rows(found: Info) -> Iterator[tuple[str, str]]:
    yield "recording", f"{', '.join(found.files)} ({found.bytes / 1e6:.1f} MB)"
    if not found.about:
        yield "dive", "unknown: it is not a recording of Lindy, or what says so cannot be read"
    if found.about:
        own = found.about.get("drone") != found.about.get("vehicle")
        shown = (*(("drone",) if own else ()), "vehicle", "link", "pilot")
        named = " · ".join(found.about[name] for name in shown if found.about.get(name))
        changed = found.about.get("overrides", "[]")
        yield "dive", named
        yield "seed", found.about.get("seed", "")
        if changed != "[]":
            with suppress(*UNDECODABLE):
                yield "set", ", ".join(msgspec.json.decode(changed, type=list[str]))
    if found.dive is not None:
        lindy = found.dive.lindy
        commit = f" ({lindy['commit']})" if lindy.get("commit") else ""
        yield "Lindy", f"{lindy.get('version', '')}{commit}, messages {lindy.get('messages', '')}"
        yield "stack", found.dive.stack.services
    if found.utc or found.about:
        yield "began", found.utc or "at 0 s of virtual time"
    armed = f", armed {found.armed_seconds:.1f} s" if found.armed_seconds else ""
    yield "length", f"{found.seconds:.1f} s{armed}"
    if found.clock_offset_ms is not None:
        bound = found.clock_bound_ms
        within = "" if bound is None else f" ± {bound:.1f}"
        yield "clocks", f"drone's minus topside's {found.clock_offset_ms:.1f}{within} ms"
    if found.log_hash is not None:
        yield "log hash", found.log_hash
    names = ", ".join(each.name for each in found.attachments)
    yield "attached", names or "nothing"


def _topics(known: Mapping[str, TopicInfo]) -> str:
    heads = ["topic", "type", "messages", "1/s", "kB", "B each"]
    rows = [
        [
            key,
            topic.type or "unknown",
            str(topic.count),
            "" if topic.hz is None else f"{topic.hz:.1f}",
            f"{topic.bytes / 1e3:.1f}",
            f"{topic.bytes / topic.count:.0f}",
        ]
        for key, topic in known.items()
    ]
    return "\n".join(aligned([heads, *rows], left=2))
