"""`lindy replay`: checks what is asked for, then plays a recording or compares with it."""

from math import isfinite
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from messages.text import harmless
from services.runtime.bus.spaces import checked_endpoint
from services.runtime.config.errors import LindyError
from tools.choices import Overrides, StackName, named
from tools.keys.credentials import is_local
from tools.log.cut import Topics
from tools.replay.differences import in_words, parsed
from tools.replay.play import onto_bus
from tools.replay.source import ReplaySource, open_source, remarks
from tools.replay.through import ThroughResult
from tools.replay.through import through as run_through
from tools.text_table import counted

SLOWEST, FASTEST = 0.01, 1000.0  # [-]
SHOWN = 20  # differences that are printed


def replay(
    recording: Annotated[Path, Parameter(converter=named)],
    /,
    *,
    speed: Annotated[float, Parameter(help="recorded seconds per second")] = 1.0,
    from_: Annotated[
        float | None, Parameter(name="--from", help="[s] since the recording began")
    ] = None,
    to: Annotated[float | None, Parameter(help="[s] since the recording began")] = None,
    topics: Topics = (),
    listen: Annotated[
        str | None, Parameter(help="endpoint for other programs, e.g. tcp/127.0.0.1:7449")
    ] = None,
    headless: Annotated[bool, Parameter(help="no viewer, even where there is a display")] = False,
    through: Annotated[
        tuple[str, ...],
        Parameter(
            help="with --diff: feed the recorded inputs of this service to today's code; "
            "repeatable: together; services that run on board",
        ),
    ] = (),
    diff: Annotated[
        bool,
        Parameter(
            help="with --through: compare its outputs with the recorded ones; exit status 1 where "
            "they differ",
        ),
    ] = False,
    tolerance: Annotated[
        tuple[str, ...],
        Parameter(help="TOPIC.FIELD=NUMBER or NUMBER% that may differ, * for any; repeatable"),
    ] = (),
    stack: StackName = "simulated",
    set_: Overrides = (),
) -> int:
    """Play a dive again, or compare today's code.

    RECORDING is a dive's folder or its MCAP file. It is played in its own time, until its end
    or Ctrl-C. A replay has keys of its own: nothing in it reaches a vehicle.

    Example: lindy replay dives/latest --from 30 --speed 4
             lindy replay dives/latest --through control --diff
    """
    if bool(through) != diff:
        raise LindyError("--through SERVICE and --diff go together: one is missing")
    if through:
        allowed, source = parsed(tolerance), opened(recording)
        found = run_through(
            source,
            through,
            stack_file=stack,
            span=span_of(source, from_, to),
            tolerances=allowed,
            overrides=set_,
        )
        print(harmless(told(through, source, found)), flush=True)
        return 1 if found.differences else 0
    if tolerance or set_:
        raise LindyError("--tolerance and --set are for --through SERVICE --diff")
    if not SLOWEST <= speed <= FASTEST:  # not a number is in no range
        raise LindyError(f"--speed is {speed:g}, expected {SLOWEST:g} to {FASTEST:g}")
    if listen is not None and not is_local(checked_endpoint(listen, "--listen")):
        raise LindyError(
            f"--listen {listen}: a replay stays on this machine; allowed is an address such as "
            f"tcp/127.0.0.1:7449"
        )
    source = opened(recording)
    span = span_of(source, from_, to)
    return onto_bus(source, span, speed=speed, patterns=topics, listen=listen, headless=headless)


def opened(path: Path) -> ReplaySource:
    """A recording, after what is to be known of it was printed.

    Raises:
        LindyError: as `open_source`.
    """
    source = open_source(path)
    for remark in remarks(source):
        print(harmless(f"{source.path}: {remark}"), flush=True)
    return source


def span_of(source: ReplaySource, begin_s: float | None, end_s: float | None) -> tuple[int, int]:
    """[ns UTC] Between two times that count from the beginning of the recording.

    Raises:
        LindyError: not within the recording, or the wrong way round.
    """
    (first, last), origin = source.span, source.origin_ns
    length = (last - origin) / 1e9
    begin, end = begin_s or 0.0, length if end_s is None else end_s
    for option, value in (("--from", begin), ("--to", end)):
        if not isfinite(value) or value < 0.0:
            raise LindyError(f"{option} is {value:g}, expected seconds from 0 to {length:.1f}")
    if begin_s is not None and end_s is not None and begin >= end:
        raise LindyError(f"--from {begin:g} is not before --to {end:g}")
    if begin > length:
        raise LindyError(f"--from is {begin:g} s, but the recording ends after {length:.1f} s")
    end = min(end, length)
    if origin + round(end * 1e9) < first:
        begins = (first - origin) / 1e9
        raise LindyError(f"--to is {end:g} s, but the recording begins at {begins:.1f} s")
    if begin >= end and begin_s is not None:
        raise LindyError(f"--from {begin:g} is not before --to {end:g}")
    return max(first, origin + round(begin * 1e9)), min(last, origin + round(end * 1e9))


def told(services: tuple[str, ...], source: ReplaySource, found: ThroughResult) -> str:
    """The result in words."""
    lines = [f"{source.path}: {remark}" for remark in found.remarks]
    if source.imported:
        return "\n".join(lines)
    messages = sum(found.compared.values())
    topics = sum(count > 0 for count in found.compared.values())
    what = f"{counted(messages, 'message')} of {counted(topics, 'topic')}"
    what += f" from {' and '.join(services)}"
    what += f" over {found.seconds:.1f} s"
    if not found.differences:
        same = "exactly as recorded" if source.virtual else "as recorded, within the tolerances"
        return "\n".join([*lines, f"{what}: {same}"])
    lines += [in_words(one, found.begin_ns) for one in found.differences[:SHOWN]]
    differ = "1 field differs"
    if len(found.differences) > 1:
        differ = f"{len(found.differences)} fields differ"
    if (rest := len(found.differences) - SHOWN) > 0:
        lines.append(f"and {rest} more fields")
    return "\n".join([*lines, f"{what}: {differ}"])
