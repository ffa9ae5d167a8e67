"""`lindy log cut`: a part of a recording as a recording of its own; `lindy log recover`: what can
be read of a damaged one. A time in which the drone was armed is one dive, which has a number."""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from math import inf
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
from cyclopts import Parameter
from mcap.records import Metadata

from messages import topics
from messages.text import harmless
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from tools.choices import NewFile
from tools.exit_status import DONE, LOST
from tools.fresh import refuse_existing
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import HASH, MENDED_BY
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.text_table import counted

Topics = Annotated[
    tuple[str, ...],
    Parameter(
        consume_multiple=True,
        help="keys, or patterns such as 'sensor/*', with blanks between; default: all",
    ),
]


def is_chosen(key: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(key, pattern) for pattern in patterns)


def require_known(patterns: Iterable[str], keys: Iterable[str], file: Path) -> None:
    """
    Raises:
        LindyError: no topic of the file is one of these.
    """
    there = sorted(keys)
    for pattern in patterns:
        if not any(fnmatchcase(key, pattern) for key in there):
            raise LindyError(
                f"--topics: no topic of {file} is {pattern!r}{nearest(pattern, there)}"
            )


BEFORE_S = AFTER_S = 5.0  # [s] of the time beside a dive that is cut out with it
# A link delivers a status late or twice by less than this. What is older is of a drone that was
# started again, and whose clock begins anew.
LATE_NS: Ns = 10_000_000_000
SHOWN = 12  # dives in a sentence


class ArmedSpan(msgspec.Struct):
    """From the first status that says armed to the first that does not."""

    from_s: float  # [s]
    to_s: float  # [s]; where it does not end in the recording, that of the recording
    ended: bool = False

    @property
    def seconds(self) -> float:
        """[s]"""
        return self.to_s - self.from_s

    @property
    def words(self) -> str:
        until = f"{self.to_s:.1f} s" if self.ended else "the end"
        return f"{self.from_s:.1f} s to {until}"


class ArmedSpans:
    """Of one recording, from every status in it, in the order of arrival."""

    def __init__(self) -> None:
        self.found: list[ArmedSpan] = []
        self._newest_ns: Ns | None = None  # stamp

    def see(self, status: VehicleStatus, t: float) -> bool:
        """A status that arrived at `t` [s]. Returns whether it is news; False: it came late, or for
        the second time, and says what was before."""
        newest = self._newest_ns
        if newest is not None and 0 <= newest - status.stamp_ns < LATE_NS:
            return False
        self._newest_ns = status.stamp_ns
        armed = self.found[-1] if self.found and not self.found[-1].ended else None
        if armed is not None:
            armed.to_s, armed.ended = t, not status.armed
        elif status.armed:
            self.found.append(ArmedSpan(t, t))
        return True

    def until(self, end: float) -> list[ArmedSpan]:
        """All of them, of a recording that ends at `end` [s]: a log of another program says that it
        is armed once, and nothing more where its power was lost."""
        if self.found and not self.found[-1].ended:
            self.found[-1].to_s = max(self.found[-1].to_s, end)
        return self.found


def around(spans: Sequence[ArmedSpan], number: int, where: str) -> tuple[float, float]:
    """[s] When the dive of that number, from 1, was, as `lindy log cut --from --to` says it: with
    some seconds before and after it, and nothing of another dive.

    Raises:
        LindyError: there is no such dive.
    """
    if not spans:
        said = f"in {where} no {topics.STATUS.key} says that the drone was armed"
        raise LindyError(f"--number {number}: {said}")
    if not 1 <= number <= len(spans):
        many = "is 1 dive" if len(spans) == 1 else f"are {len(spans)} dives"
        listed = [f"{n}: {span.words}" for n, span in enumerate(spans[:SHOWN], start=1)]
        listed += [f"and {len(spans) - SHOWN} more"] if len(spans) > SHOWN else []
        raise LindyError(f"--number {number}: in {where} there {many} ({', '.join(listed)})")
    span = spans[number - 1]
    earliest = spans[number - 2].to_s if number > 1 else 0.0
    latest = spans[number].from_s if number < len(spans) else inf
    to_s = min(span.to_s + AFTER_S, latest) if span.ended else inf
    return max(span.from_s - BEFORE_S, earliest), to_s


def armed_spans(recording: Recording) -> list[ArmedSpan]:
    origin, spans = recording.origin_ns() or 0, ArmedSpans()
    with reading("looking for dives", recording.size) as recording.advance:
        for _, status, log_ns, _ in recording.of(topics.STATUS):
            if isinstance(status, VehicleStatus):
                spans.see(status, (log_ns - origin) / 1e9)
    return spans.found


CUT = "cut"  # name of metadata


def cut(
    recording: Path,
    /,
    *,
    out: NewFile,
    from_: Annotated[
        float, Parameter(name="--from", help="[s] since the recording began, inclusive")
    ] = 0.0,
    to: Annotated[float, Parameter(help="[s] exclusive; default: to its end")] = inf,
    number: Annotated[
        int | None,
        Parameter(
            help="in place of --from and --to: the dive of this number, from 1, of `lindy log "
            "info`: armed to disarmed, with 5 s before and after, and nothing of another dive",
        ),
    ] = None,
    topics: Topics = (),
) -> int:
    """Cut a part out, as a recording of its own.

    Any MCAP reader opens it. RECORDING is a dive's folder or its MCAP file. Attached files and
    schemas are kept, and so are the seconds: a part of a part has those of the whole. Exit status
    3: the recording is damaged in that part, or was not finished.

    Example: lindy log cut dives/latest --from 30 --to 40 --topics state 'sensor/*' --out part.mcap
             lindy log cut dives/class/rov1 --number 2 --out dive2.mcap
    """
    refuse_existing(out)
    opened = open_recording(recording)
    if number is not None:
        if (from_, to) != (0.0, inf):
            raise LindyError(f"--number {number} says from when to when; leave out --from and --to")
        from_, to = around(armed_spans(opened), number, str(recording))
    for option, value in (("--from", from_), ("--to", to)):
        if not value >= 0.0:  # NaN neither
            raise LindyError(f"{option} is {value:g}, expected seconds from 0")
    if not from_ < to:
        raise LindyError(f"--from is {from_:g} s and --to {to:g} s; expected from before to")
    messages = counted(cut_out(opened, out, from_, to, topics), "message")
    print(harmless("\n".join([f"{messages} written to {out}", *opened.damage])), flush=True)
    return LOST if opened.damage else DONE


def cut_out(
    recording: Recording, out: Path, from_s: float, to_s: float, topics: Sequence[str] = ()
) -> int:
    """Returns the number of messages.

    Args:
        from_s: [s] since the dive began, inclusive.
        to_s: [s] exclusive.
        topics: keys or patterns such as sensor/*; empty: all.

    Raises:
        LindyError: nothing is in that part, or the file cannot be written.
    """
    origin = recording.origin_ns()
    if origin is None:
        raise recording.empty(recording.files[0])
    begin, end = (  # whole [ns], as the times of messages are, unless it is beyond all of them
        origin + (round(ns) if ns < inf else ns) for ns in (1e9 * from_s, 1e9 * to_s)
    )
    keys = set[str]()

    def wants(key: str) -> bool:
        keys.add(key)
        return is_chosen(key, topics)

    with reading("cutting", recording.size) as recording.advance, new_mcap(out) as copy:
        for file in recording.files:
            recording.copy(file, copy, but=(HASH, CUT), wants=wants, within=(begin, end))
        require_known(topics, keys, recording.files[0])
        if copy.is_empty:
            until = "its end" if to_s == inf else f"{to_s:g} s"
            raise LindyError(
                f"{recording.files[0]} holds no such message from {from_s:g} s to {until}"
            )
        about = {
            "origin_ns": str(origin),
            "from_s": repr(float(from_s)),
            "to_s": repr(float(to_s)),
            "topics": " ".join(topics),
        }
        copy.metadata(Metadata(CUT, about))
    return copy.messages


class Recovered(NamedTuple):
    messages: int
    attachments: int
    wrong: list[str]  # what was wrong with the files; empty: nothing was missing


def recover(recording: Path, /, *, out: NewFile) -> int:
    """Save what can be read of a damaged recording.

    RECORDING is a dive's folder or its MCAP file, of whatever length, cut off or damaged. All that
    can still be read is written as a new file. Exit status 1: neither a
    message nor an attached file of it is whole.

    Example: lindy log recover broken.mcap --out mended.mcap
    """
    refuse_existing(out)
    found = recovered(recording, out)
    files = f" and {counted(found.attachments, 'attached file')}" if found.attachments else ""
    wrong = "; ".join(found.wrong) or "nothing was missing"
    messages = counted(found.messages, "message")
    print(harmless(f"{messages}{files} written to {out}: {wrong}"), flush=True)
    return 0


def recovered(path: Path, out: Path) -> Recovered:
    """
    Raises:
        LindyError: nothing can be read, or the file cannot be written.
    """
    recording = open_recording(path)
    with reading("recovering", recording.size) as recording.advance, new_mcap(out) as copy:
        for file in recording.files:
            recording.copy(file, copy)
        wrong = [said.removesuffix(f"; {MENDED_BY}") for said in recording.damage]
        if copy.is_empty and not copy.attachments:
            raise LindyError(f"nothing can be recovered from {path}: no message in it is whole")
        if copy.orphans:
            are = "is" if copy.orphans == 1 else "are"
            wrong.append(f"{counted(copy.orphans, 'message')} of unknown topics {are} left out")
        about = {file.name: str(file.stat().st_size) for file in recording.files}
        copy.metadata(Metadata("recovered", about | {"found": "; ".join(wrong)}))
    return Recovered(copy.messages, copy.attachments, wrong)
