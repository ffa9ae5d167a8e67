"""`lindy simulate`: the same stack, script and files on virtual time, as fast as possible."""

import sys
import time
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager

import msgspec
from rich.progress import BarColumn, Progress, TextColumn

from messages import topics
from messages.health import LogLine
from services.runtime.config.errors import LindyError
from services.runtime.hosts.garbage_collection import rare_collections
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.launch.supervisor import NAME
from tools.checks import DEFAULT_PILOT, checked, pilot_of
from tools.choices import Choices
from tools.live.display import LineDisplay
from tools.live.dive_folder import out_folder, point_latest
from tools.live.dive_timeline import DiveTimeline
from tools.live.log_lines import when
from tools.live.outcome import Outcome, title
from tools.live.stop_signals import StopSignals
from tools.live.viewer import runnable

STRIDE_NS = 100_000_000  # [ns] of virtual time between two checks of the dive
LINE_S = 10.0  # [s] of virtual time between two lines

Advance = Callable[[DiveTimeline, int], None]


def simulate(choices: Choices) -> int:
    """Returns the exit status: 0 clean, 3 done but data or a service was lost.

    Raises:
        LindyError: a wrong setting, or the dive was aborted.
    """
    pilot = pilot_of(choices.pilot or DEFAULT_PILOT)
    if pilot.script_s is None:
        raise LindyError(f"--pilot {pilot.name} needs real time; simulate flies script:FILE only")
    services = runnable(Registry.read(choices.stack))
    services.require_whole()
    stack = checked(choices, pilot, services)
    stack = msgspec.structs.replace(stack, virtual=True, out=str(out_folder(choices.out)))
    outcome = Outcome(stack)
    timeline = DiveTimeline(pilot.script_s, choices.seconds)
    host, shown = VirtualHost(), LineDisplay()

    def show(line: LogLine) -> None:
        shown.line(line, timeline.elapsed_s(line.stamp_ns))

    print(f"{title(stack)} → {stack.out_dir}", flush=True)
    with StopSignals() as stop, outcome.of_the_dive(), progress() as advance, closing(host):
        node = host.node(NAME, ["topside"])
        node.each(topics.STATUS, timeline.see)
        outcome.listen(node)
        host.add_all(services, stack)
        services.require_published({name: host.nodes[name].published for name in services})
        point_latest(stack.out_dir)
        host.show(lambda line: None if line.level == "info" else show(line))
        began = time.perf_counter()
        with rare_collections():
            outcome.exit = run(host, timeline, stop, advance)
        outcome.speedup = host.now / 1e9 / (time.perf_counter() - began)
    shown.finish()
    return outcome.sum_up()


def run(host: VirtualHost, timeline: DiveTimeline, stop: StopSignals, advance: Advance) -> str:
    """Run to the end of the dive. Returns how it ended: `clean`, or why otherwise."""
    end = None
    while end is None:
        host.run(host.now + STRIDE_NS)
        advance(timeline, host.now)
        end = "interrupted" if stop.asked else timeline.over(host.now)
    return end


@contextmanager
def progress() -> Generator[Advance]:
    """A progress bar on a terminal, otherwise a line every `LINE_S`."""
    if not sys.stdout.isatty():
        yield _lines()
        return
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %")
    with Progress(*columns, transient=True) as bar:
        task = bar.add_task("waiting for the drone")

        def advance(timeline: DiveTimeline, now: int) -> None:
            bar.update(
                task,
                description="diving" if timeline.armed else timeline.note,
                total=timeline.length_s,
                completed=timeline.elapsed_s(now) or 0.0,
            )

        yield advance


def _lines() -> Advance:
    last_s = 0.0

    def advance(timeline: DiveTimeline, now: int) -> None:
        nonlocal last_s
        if now / 1e9 - last_s >= LINE_S:
            last_s = now / 1e9
            elapsed = timeline.elapsed_s(now)
            state = "armed" if timeline.armed else timeline.note
            print(f"{'':<7} {when(elapsed):>8}  {state}", flush=True)

    return advance
