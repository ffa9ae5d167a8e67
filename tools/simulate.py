"""`lindy simulate`: the same stack, script and files on virtual time, as fast as possible."""

import sys
from collections.abc import Callable, Collection, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, NamedTuple

from cyclopts import Parameter
from rich.progress import BarColumn, Progress, TextColumn

from messages.health import LogLine
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.vehicle_view.log_lines import when
from tools.checks import DEFAULT_PILOT, PilotChoice, pilot_of
from tools.choices import SCRIPTED, Choices, ScriptedChoices, named
from tools.exit_status import DONE
from tools.live.cockpit import runnable, with_further_cameras
from tools.live.dive_folder import dive_files, point_latest
from tools.live.dive_timeline import DiveTimeline
from tools.live.outcome import Outcome, title
from tools.live.screen import LineDisplay
from tools.live.stop_signals import StopSignals
from tools.live.virtual_dive import Advance, MemoryRecorder, fly, without_files
from tools.recordings.recording import log_hash
from tools.report.summary import summary
from tools.start import as_given, settled

LINE_S = 10.0  # [s] of virtual time between two lines


class Simulated(NamedTuple):
    """A dive that was flown on virtual time."""

    status: int  # exit status
    log_hash: str | None  # None: its recording was not finished
    folder: Path | None  # None: without files


def simulate(
    *,
    choices: ScriptedChoices = SCRIPTED,
    files: Annotated[
        bool,
        Parameter(
            negative="--no-files",
            help="--no-files: no recording, no viewer, no folder; the report only, sooner",
        ),
    ] = True,
    from_: Annotated[
        Path | None,
        Parameter(
            name="--from",
            converter=named,
            help="folder or MCAP file of a recorded dive: fly it again, from nothing else, and "
            "fail (exit status 1) where what is recorded is not the same, bit for bit",
        ),
    ] = None,
    trust: Annotated[
        bool,
        Parameter(negative=(), help="with --from, run code in it that is not Lindy's own, too"),
    ] = False,
) -> int:
    """Fly a dive on virtual time, as fast as possible.

    It is the same dive as that of `lindy dive`, with the same files. Exit status 3: data was lost,
    or a service did not work for a while.

    Example: lindy simulate --seed 7 --set control.depth.kp=3 --out dives/simulated
             lindy simulate --no-files --link severe
             lindy simulate --from dives/latest
    """
    if from_ is not None:
        from tools.fly_again import fly_again

        return fly_again(from_, choices, files=files, trust=trust)
    return simulated(choices, files=files).status


def simulated(choices: Choices, *, files: bool = True, running: Collection[str] = ()) -> Simulated:
    """

    Args:
        files: False: no recorder, no viewer, no folder; the report comes from memory.
        running: services of the stack that take part, the viewer too; empty: all that can here.

    Raises:
        LindyError: a wrong setting, or the dive was aborted.
    """
    pilot, services = scripted(choices), Registry.read(choices.stack)
    services.require_whole()
    services = with_further_cameras(services, choices)
    if files or running:
        services = runnable(services)
    if running:
        services = services.only({n: spec for n, spec in services.items() if n in running})
    elif not files:
        services = without_files(services)
    if files:
        stack = settled(choices, pilot, services, name=as_given, virtual=True)
        return _recorded(stack, services, pilot)
    if choices.out is not None:
        raise LindyError("--out names a folder for files, and --no-files writes none; drop one")
    with TemporaryDirectory(prefix="lindy-") as folder:  # for a user's service that writes files
        stack = settled(choices, pilot, services, name=as_given, virtual=True, out=folder)
        return _in_memory(stack, services, pilot)


def scripted(choices: Choices) -> PilotChoice:
    """Raises LindyError: there is no such script, or the pilot is a person."""
    pilot = pilot_of(choices.pilot or DEFAULT_PILOT)
    if pilot.script_s is None:
        raise LindyError(f"--pilot {pilot.name} needs real time; simulate flies script:FILE only")
    return pilot


def _recorded(stack: Stack, services: Registry, pilot: PilotChoice) -> Simulated:
    outcome = Outcome(stack)
    timeline = DiveTimeline(pilot.script_s, stack.seconds)

    def begun() -> None:
        print(f"{title(stack)} → {stack.out_dir}", flush=True)
        point_latest(stack.out_dir)

    with StopSignals(in_process=True) as stop:
        try:
            _fly_and_show(stack, services, timeline, outcome, stop, begun)
        except NeedsRealTimeError:
            for kind in ("mcap", "rrd"):  # empty: a recorder began before it was known
                for path in dive_files(stack.out_dir, kind):
                    path.unlink()
            raise
        status = stop.report(outcome.sum_up)
    return Simulated(status, log_hash(stack.out_dir), stack.out_dir)


def _in_memory(stack: Stack, services: Registry, pilot: PilotChoice) -> Simulated:
    memory, outcome = MemoryRecorder(), Outcome(stack)
    timeline = DiveTimeline(pilot.script_s, stack.seconds)

    def begun() -> None:
        print(f"{title(stack)}, without files", flush=True)

    with StopSignals(in_process=True) as stop:
        _fly_and_show(stack, services, timeline, outcome, stop, begun, memory)
        status = stop.report(lambda: _sum_up_memory(outcome, memory), "nothing was recorded")
    return Simulated(status, memory.log_hash(), None)


def _sum_up_memory(outcome: Outcome, memory: MemoryRecorder) -> int:
    dive = memory.dive()
    outcome.require_dive(dive)
    report = outcome.report_in_memory(dive, memory.log_hash())
    print(summary(report, dive.max_depth_m, all_losses=True), flush=True)
    outcome.complain()
    return DONE


def _fly_and_show(
    stack: Stack,
    services: Registry,
    timeline: DiveTimeline,
    outcome: Outcome,
    stop: StopSignals,
    begun: Callable[[], None],
    memory: MemoryRecorder | None = None,
) -> None:
    shown = LineDisplay()

    def show(line: LogLine) -> None:
        shown.line(line, timeline.elapsed_s(line.stamp_ns))

    with progress() as advance:
        fly(
            *(stack, services, timeline, outcome),
            stop=lambda: stop.asked,
            memory=memory,
            begun=begun,
            advance=advance,
            show=show,
        )
    shown.finish()


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
                description="diving" if timeline.armed else _note(timeline),
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
            state = "armed" if timeline.armed else _note(timeline)
            with suppress(OSError):  # whoever read it may be gone, and the dive goes on
                print(f"{'':<7} {when(elapsed):>8}  {state}", flush=True)

    return advance


def _note(timeline: DiveTimeline) -> str:
    """Why the drone is not armed, without the advice to keep it still: nobody holds it here."""
    return "calibrating" if timeline.calibrating else timeline.note
