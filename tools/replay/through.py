"""`lindy replay FILE --through SERVICE --diff`: today's code on the inputs of a recorded dive."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

from messages import topics
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.hosts.loop import rare_collections
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.replay.differences import (
    A_FEW,
    DAMAGED,
    RARELY,
    REAL_TIME,
    VIRTUAL,
    Difference,
    FieldComparison,
    Pair,
    Told,
    Tolerance,
    by_cause,
    by_seq,
    require_fields,
)
from tools.replay.on_board import OnBoard
from tools.replay.source import ReplaySource
from tools.text_table import counted

CANNOT = (
    "simulator, gamepad, mavlink, ardusub, tether, recorder and visualizer cannot, because a "
    "simulated world, a device, another program, the far end of the link or a file is part of "
    "what they do, and none of these is in a recording; link_monitor and predictor cannot, because "
    "a recording made on board does not say when messages arrived topside"
)
POSSIBLE = ("estimation", "reference", "control")
APART_NS = 20_000_000  # [ns] between two stamps of one message, where a real clock decided
# Not compared without it: control answers where it is silent.
MOSTLY_OF = {topics.PILOT_ANSWER.key: "reference"}


Window = tuple[int, int]  # [ns] what is compared: stamps by the services' clock, ends included


@dataclass
class ThroughResult:
    """What a process replay found."""

    differences: list[Difference]
    compared: dict[str, int]  # messages by key
    begin_ns: int  # [ns] by the services' clock, from which times are counted
    seconds: float  # [s] compared
    remarks: list[str]


def through(
    source: ReplaySource,
    names: Sequence[str],
    *,
    stack_file: str = "simulated",
    span: tuple[int, int] | None = None,
    tolerances: Sequence[Tolerance] = (),
    overrides: Sequence[str] = (),
) -> ThroughResult:
    """Replay a recording through services and compare what they publish.

    Args:
        names: of services that run on one side.
        stack_file: a name in deploy/stacks, or the path of a TOML file.
        span: [ns UTC] compare from here to there only; the replay always begins with the dive,
            because a service has a memory.
        tolerances: in front of the declared ones.
        overrides: key.path=value into the vehicle file, besides those of the dive.

    Raises:
        LindyError: a service that cannot be replayed, or settings that are refused.
    """
    services = Registry.read(stack_file)
    _require_on_board(names, services, source)
    first, last = source.span
    begin, end = span or (first, last)
    with source.stack() as stack, rare_collections():
        stack.overrides.extend(overrides)
        stack.check(known_tables(services), recorded=True)
        ordered = tuple(name for name in services if name in names)
        replay = OnBoard(source, ordered, services, stack)
        replay.run(end)
    offset, restart = source.utc_offset_ns, _first_restart(replay.recorded)
    until = end if restart is None else restart + offset - 1
    # Of its last instant a recording that was cut off may have what was published and not why.
    window = max(first, begin) - offset, min(last - 1, until) - offset
    today = (told for key in replay.outputs.keys for told in replay.outputs.of(key))
    require_fields(tolerances, chain(replay.recorded, today))
    found = _compared(replay, names, source, window, tolerances)
    if source.cut:
        found.remarks.append(
            "it is a part of a recording: what was said before is not in it, from which "
            "differences may come"
        )
    if source.imported:
        found.remarks.append(_published(replay, end - offset))
    if restart is not None:
        at = (restart - found.begin_ns) / 1e9
        found.remarks.append(f"it was started again at {at:.1f} s: compared up to there")
    return found


def _published(replay: OnBoard, until_ns: int) -> str:
    """What today's code made of a log of another program, with which nothing can be compared."""
    counts: dict[str, int] = {}
    for key in sorted(replay.outputs.keys):
        told = [one for one in replay.outputs.of(key) if one.stamp_ns <= until_ns]
        counts[key] = len(told)
    said = ", ".join(f"{count} of {key}" for key, count in counts.items() if count) or "nothing"
    return f"imported, so there is nothing to compare with; today's code publishes {said}"


def _compared(
    replay: OnBoard,
    names: Sequence[str],
    source: ReplaySource,
    window: Window,
    tolerances: Sequence[Tolerance],
) -> ThroughResult:
    """What was recorded in a window, and what is published today."""
    remarks: list[str] = []
    declared = VIRTUAL if source.virtual else REAL_TIME
    if damaged := source.damaged:
        declared = (*DAMAGED, *declared)
        remarks.append(
            f"{damaged} messages were damaged on their way and are not in the recording: how many "
            f"messages a service received or could not read is not compared"
        )
    if unread := sum(source.recording.unreadable.values()):
        remarks.append(f"{counted(unread, 'message')} could not be read")
    comparison = FieldComparison((*tolerances, *declared), common_only=bool(source.other_messages))
    compared: dict[str, int] = {}
    inside: defaultdict[str, list[Told]] = defaultdict(list)
    begin_ns, end_ns = window
    for told in replay.recorded:
        if begin_ns <= told.stamp_ns <= end_ns:
            inside[told.key].append(told)
    for key in sorted({*inside, *replay.outputs.keys}):
        if MOSTLY_OF.get(key, names[0]) not in names:
            continue
        before = comparison.compared
        today = [told for told in replay.outputs.of(key) if told.stamp_ns <= end_ns]
        for pair in _pairs(inside[key], today, source, window):
            comparison.compare(pair)
        compared[key] = comparison.compared - before
    seconds = max(0, end_ns - begin_ns) / 1e9
    found = comparison.differences
    if not source.virtual:
        found = [one for one in found if one.count > max(A_FEW, RARELY * compared[one.key])]
        if rare := len(comparison.differences) - len(found):
            remarks.append(
                f"{rare} fields differ in at most {RARELY:.0%} of their messages or in {A_FEW}: on "
                f"a real clock, what arrives together may be handled in another order"
            )
    origin_ns = source.origin_ns - source.utc_offset_ns
    return ThroughResult(found, compared, origin_ns, seconds, remarks)


def _pairs(
    recorded: list[Told],
    today: list[Told],
    source: ReplaySource,
    window: Window,
) -> Iterator[Pair]:
    if source.virtual:
        return by_seq(recorded, today) if source.thinned else by_seq(recorded, today, *window)
    topic = topics.find(recorded[0].key) if recorded else None
    period = 1e9 / topic.hz if topic is not None and topic.hz else APART_NS
    return by_cause(recorded, today, min(APART_NS, round(period / 2)))


def _first_restart(recorded: Sequence[Told]) -> int | None:
    """[ns] The first message of a service's second life, which counts from 0 again."""
    newest: dict[str, int] = {}
    for told in recorded:
        if told.seq < newest.get(told.key, 0) and told.seq == 0:
            return told.stamp_ns
        newest[told.key] = told.seq
    return None


def _require_on_board(names: Sequence[str], services: Registry, source: ReplaySource) -> None:
    """
    Raises:
        LindyError: an unknown service, one that cannot be replayed, or one that runs topside.
    """
    for name in names:
        if name not in services:
            raise LindyError(f"--through {name}: unknown service{nearest(name, list(POSSIBLE))}")
        spec = services[name]
        if name not in source.processes and not source.imported:
            raise LindyError(
                f"--through {name}: {source.path} has no health of it, so it did not run in that "
                f"dive; found {', '.join(sorted(source.processes)) or 'none'}"
            )
        if spec.module is None and (spec.service or name) not in POSSIBLE:
            raise LindyError(f"--through {name}: allowed are {', '.join(POSSIBLE)}; {CANNOT}")
        if spec.sides[0] != "drone":
            raise LindyError(
                f"--through {name}: it runs topside, and a recording made on board does not say "
                f"when messages arrived there"
            )
