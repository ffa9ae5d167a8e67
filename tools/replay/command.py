"""`lindy replay`: checks what is asked for, then plays a recording or compares with it."""

from math import isfinite
from pathlib import Path

from services.runtime.bus.endpoint import checked_endpoint
from services.runtime.config.errors import LindyError
from tools.keys.door import is_local
from tools.replay.differences import in_words
from tools.replay.onto_bus import Wish, onto_bus
from tools.replay.source import ReplaySource, open_source, remarks
from tools.replay.through import ThroughResult, through
from tools.replay.tolerances import parsed

SLOWEST, FASTEST = 0.01, 1000.0  # [-]
SHOWN = 20  # differences that are printed


def play(
    path: Path,
    *,
    speed: float,
    loop: bool,
    begin_s: float | None,
    end_s: float | None,
    patterns: tuple[str, ...],
    connect: str | None,
    listen: str | None,
    headless: bool,
) -> int:
    """Onto a bus. Returns the exit status.

    Raises:
        LindyError: a wrong argument or recording, or a hub that lets no replay through.
    """
    if not SLOWEST <= speed <= FASTEST:  # not a number is in no range
        raise LindyError(f"--speed is {speed:g}, expected {SLOWEST:g} to {FASTEST:g}")
    if connect is not None and listen is not None:
        raise LindyError("--connect plays to a hub that is running, --listen starts one; drop one")
    for option, endpoint in (("--connect", connect), ("--listen", listen)):
        if endpoint is not None and not is_local(checked_endpoint(endpoint, option)):
            raise LindyError(
                f"{option} {endpoint}: a replay stays on this machine; allowed is an address such "
                f"as tcp/127.0.0.1:7449"
            )
    source = opened(path)
    wish = Wish(span_of(source, begin_s, end_s), speed, loop, patterns)
    return onto_bus(source, wish, connect=connect, listen=listen, headless=headless)


def compare(
    path: Path,
    services: tuple[str, ...],
    *,
    begin_s: float | None,
    end_s: float | None,
    tolerances: tuple[str, ...],
    overrides: tuple[str, ...],
    stack_file: str,
) -> int:
    """Through services. Returns the exit status: 1 where something differs.

    Raises:
        LindyError: a wrong argument or recording, or a service that cannot be replayed.
    """
    allowed = parsed(tolerances)
    source = opened(path)
    found = through(
        source,
        services,
        stack_file=stack_file,
        span=span_of(source, begin_s, end_s),
        tolerances=allowed,
        overrides=overrides,
    )
    print(told(services, source, found), flush=True)
    return 1 if found.differences else 0


def opened(path: Path) -> ReplaySource:
    """A recording, after what is to be known of it was printed.

    Raises:
        LindyError: as `open_source`.
    """
    source = open_source(path)
    for remark in remarks(source):
        print(f"{source.path}: {remark}", flush=True)
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
    if origin + round(end * 1e9) < first:
        begins = (first - origin) / 1e9
        raise LindyError(f"--to is {end:g} s, but the recording begins at {begins:.1f} s")
    if begin >= end and begin_s is not None:
        raise LindyError(f"--from {begin:g} is not before --to {end:g}")
    return max(first, origin + round(begin * 1e9)), min(last, origin + round(end * 1e9))


def told(services: tuple[str, ...], source: ReplaySource, found: ThroughResult) -> str:
    """The result in words."""
    lines = [f"{source.path}: {remark}" for remark in found.remarks]
    messages = sum(found.compared.values())
    topics = sum(count > 0 for count in found.compared.values())
    what = f"{messages} messages of {topics} topics from {' and '.join(services)}"
    what += f" over {found.seconds:.1f} s"
    if not found.differences:
        same = "exactly as recorded" if source.virtual else "as recorded, within the tolerances"
        return "\n".join([*lines, f"{what}: {same}"])
    lines += [in_words(one, found.begin_ns) for one in found.differences[:SHOWN]]
    if (rest := len(found.differences) - SHOWN) > 0:
        lines.append(f"and {rest} more fields")
    return "\n".join([*lines, f"{what}: {len(found.differences)} fields differ"])
