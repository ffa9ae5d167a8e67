"""`lindy replay FILE --through SERVICE --diff`: today's code on the inputs of a recorded dive."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from messages import topics
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.hosts.garbage_collection import rare_collections
from services.runtime.hosts.registry import Registry
from tools.replay.differences import Comparison, Difference, Pair, Told, Tolerance, by_seq, by_stamp, stood_in
from tools.replay.on_board import OnBoard
from tools.replay.source import ReplaySource
from tools.replay.tolerances import REAL_TIME, VIRTUAL
from tools.replay.topside import Topside

CANNOT = (
    "simulator, gamepad, keyboard, mavlink, ardusub, tether, recorder and visualizer cannot: they "
    "work from a simulated world, a device, another program, the other end of the link or for a "
    "file, and none of these is in a recording"
)
POSSIBLE = ("estimation", "reference", "control", "link_monitor", "predictor")
APART_NS = 20_000_000  # [ns] between two stamps of one message, where a real clock decided
IN_PLACE_OF = {topics.PILOT_ANSWER.key: "reference"}  # control answers where reference is silent


@dataclass
class ThroughResult:
    """What a process replay found."""

    differences: list[Difference]
    compared: dict[str, int]  # messages by key
    begin_ns: int  # [ns] by the services' clock, from which times are counted
    seconds: float  # [s] compared
    remarks: list[str] = field(default_factory=list[str])


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
    side = _side_of(names, services, source)
    first, last = source.span
    begin, end = span or (first, last)
    with TemporaryDirectory(prefix="lindy-") as folder, rare_collections():
        stack = source.stack(Path(folder))
        stack.overrides.extend(overrides)
        ordered = tuple(name for name in services if name in names)
        kind = OnBoard if side == "drone" else Topside
        replay = kind(source, ordered, services, stack)
        replay.run(end)
    offset = source.utc_offset_ns
    remarks = [*replay.remarks]
    cut = _first_restart(replay.recorded)
    if cut is not None:
        at = (cut - first + offset) / 1e9
        remarks.append(f"it was started again at {at:.1f} s: compared up to there")
    inside = _inside(replay.recorded, begin - offset, end - offset, cut)
    wanted = (*tolerances, *(VIRTUAL if source.virtual else REAL_TIME))
    comparison = Comparison(wanted, common_only=bool(source.other_messages))
    compared: dict[str, int] = {}
    for key, told in sorted(inside.items()):
        before = comparison.compared
        today = replay.outputs.of(key)
        others = key in IN_PLACE_OF and IN_PLACE_OF[key] not in names
        for pair in stood_in(told, today) if others else _pairs(told, today, source):
            comparison.compare(pair)
        compared[key] = comparison.compared - before
    seconds = max(0, end - max(begin, first)) / 1e9
    return ThroughResult(comparison.differences, compared, first - offset, seconds, remarks)


def _pairs(recorded: list[Told], today: list[Told], source: ReplaySource) -> Iterator[Pair]:
    if source.virtual:
        return by_seq(recorded, today, thinned=source.thinned)
    topic = topics.find(recorded[0].key)
    period = 1e9 / topic.hz if topic is not None and topic.hz else APART_NS
    return by_stamp(recorded, today, min(APART_NS, round(period / 2)))


def _inside(
    recorded: Iterable[Told], begin: int, end: int, cut: int | None
) -> dict[str, list[Told]]:
    """Recorded messages in this span of stamps, by key."""
    found: dict[str, list[Told]] = defaultdict(list)
    for told in recorded:
        if begin <= told.stamp_ns <= end and (cut is None or told.stamp_ns < cut):
            found[told.key].append(told)
    return found


def _first_restart(recorded: Sequence[Told]) -> int | None:
    """[ns] The first message of a service's second life, which counts from 0 again."""
    newest: dict[str, int] = {}
    for told in recorded:
        if told.seq < newest.get(told.key, 0) and told.seq == 0:
            return told.stamp_ns
        newest[told.key] = told.seq
    return None


def _side_of(names: Sequence[str], services: Registry, source: ReplaySource) -> str:
    """The side on which all of these services run.

    Raises:
        LindyError: an unknown service, one that cannot be replayed, or services of both sides.
    """
    for name in names:
        if name not in services:
            raise LindyError(f"--through {name}: unknown service{nearest(name, list(POSSIBLE))}")
        spec = services[name]
        if spec.module is None and (spec.service or name) not in POSSIBLE:
            raise LindyError(f"--through {name}: allowed are {', '.join(POSSIBLE)}; {CANNOT}")
    sides = {services[name].sides[0] for name in names}
    if len(sides) > 1:
        raise LindyError(
            f"--through {', '.join(names)}: they run on two sides; allowed are services of one"
        )
    (side,) = sides
    if side != "drone" and not source.virtual:
        raise LindyError(
            f"--through {names[0]}: it runs topside, and a recording made on board does not say "
            f"when messages arrived there; allowed is a recording of `lindy simulate`, whose link "
            f"can be run again"
        )
    return side
