"""`lindy log cut`: a part of a recording as a recording of its own."""

from math import inf
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter
from mcap.records import Metadata

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import NewFile
from tools.exit_status import DONE, LOST
from tools.fresh import refuse_existing
from tools.log.armed_spans import armed_spans, around
from tools.log.topic_patterns import Topics, is_chosen, require_known
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import HASH, StoredMessage
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

CUT = "cut"  # name of metadata


class WantedPart(NamedTuple):
    """Which messages to keep."""

    from_s: float = 0.0  # [s] since the dive began, inclusive
    to_s: float = inf  # [s] exclusive
    topics: tuple[str, ...] = ()  # keys or patterns such as sensor/*; empty: all


def cut(
    recording: Path,
    *,
    out: NewFile,
    from_: Annotated[
        float, Parameter(name="--from", help="[s] since the recording began, inclusive")
    ] = 0.0,
    to: Annotated[float, Parameter(help="[s] exclusive; default: to its end")] = inf,
    dive: Annotated[
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
             lindy log cut dives/class/rov1 --dive 2 --out dive2.mcap
    """
    refuse_existing(out)
    opened = open_recording(recording)
    if dive is not None:
        if (from_, to) != (0.0, inf):
            raise LindyError(f"--dive {dive} says from when to when; leave out --from and --to")
        from_, to = around(armed_spans(opened), dive, str(recording))
    for option, value in (("--from", from_), ("--to", to)):
        if not value >= 0.0:  # NaN neither
            raise LindyError(f"{option} is {value:g}, expected seconds from 0")
    if not from_ < to:
        raise LindyError(f"--from is {from_:g} s and --to {to:g} s; expected from before to")
    messages = cut_out(opened, out, WantedPart(from_, to, topics))
    print(
        harmless("\n".join([f"{messages} messages written to {out}", *opened.damage])), flush=True
    )
    return LOST if opened.damage else DONE


def cut_out(recording: Recording, out: Path, wanted: WantedPart) -> int:
    """Returns the number of messages.

    Raises:
        LindyError: nothing is in that part, or the file cannot be written.
    """
    origin = recording.origin_ns()
    if origin is None:
        raise recording.empty(recording.files[0])
    begin, end = (  # whole [ns], as the times of messages are, unless it is beyond all of them
        origin + (round(ns) if ns < inf else ns) for ns in (1e9 * wanted.from_s, 1e9 * wanted.to_s)
    )
    keys = set[str]()

    def wants(key: str) -> bool:
        keys.add(key)
        return is_chosen(key, wanted.topics)

    with reading("cutting", recording.size) as recording.advance, new_mcap(out) as copy:
        for file in recording.files:
            copy.next_file()
            for record in recording.records(file, wants, (begin, end)):
                if isinstance(record, StoredMessage):
                    is_in = begin <= record.log_ns < end
                else:  # the hash is that of the whole
                    is_in = not (isinstance(record, Metadata) and record.name in (HASH, CUT))
                if is_in:
                    copy.add(record)
        require_known(wanted.topics, keys, recording.files[0])
        if copy.is_empty:
            until = "its end" if wanted.to_s == inf else f"{wanted.to_s:g} s"
            raise LindyError(
                f"{recording.files[0]} holds no such message from {wanted.from_s:g} s to {until}"
            )
        about = {
            "origin_ns": str(origin),
            "from_s": repr(float(wanted.from_s)),
            "to_s": repr(float(wanted.to_s)),
            "topics": " ".join(wanted.topics),
        }
        copy.metadata(Metadata(CUT, about))
    return copy.messages
