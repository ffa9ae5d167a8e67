"""The cells: all faults in all modes on virtual time, on all cores, and some in real processes.

Each virtual cell is flown by a copy (fork) of a process with an armed dive, from one instant on.
"""

import gc
import multiprocessing
import subprocess
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from tests.support.faults.catalogue import ONLOOKERS, FaultCase, of
from tests.support.faults.figures import Figures, disarmed, figures, with_disarm
from tests.support.faults.modes import DOWN, MODES, FlownMode
from tests.support.faults.observed import FaultDive
from tests.support.faults.real_dive import RealFaultDive, real_dive
from tests.support.faults.virtual_dive import VirtualDive

REQUEST_S = 6.0  # [s] for which a request is repeated, and thrusters come to rest
LOOK_S = 0.1  # [s] between two looks at them
MORE_S = 2.0  # [s] longer than on virtual time: a busy computer starts processes slowly
LONGEST_RECOVERY_S = 45.0  # [s] after the beginning, for the pilot to be in control again
PILOTED = FlownMode("stabilised", "pioneer", (*DOWN, "7,0.3,0,0,0,,"), 10.0)
AT_REST = FlownMode("stabilised", "pioneer", DOWN, 9.0)  # a stick that is out refuses to arm


class FaultCell(NamedTuple):
    mode: FlownMode
    fault: FaultCase


class FlownCell(NamedTuple):
    cell: FaultCell
    figures: Figures
    note: str = ""  # what else was measured


# Fault by fault, so that a run that is broken off has something of every mode.
VIRTUAL_CELLS = tuple(FaultCell(mode, fault) for fault in of("virtual") for mode in MODES)


def fly(dive: FaultDive, cell: FaultCell, more_s: float = 0.0) -> Figures:
    """Let a fault happen, and measure what the drone does."""
    begin, fault = dive.now, cell.fault
    fault.begin(dive)
    dive.run(fault.flown)
    fault.end(dive)
    dive.run(fault.after + more_s)
    return figures(dive.seen, begin, dive.now, holds_depth=cell.mode.holds_depth)


def disarm(dive: FaultDive, fault: FaultCase) -> float | None:
    """[s] How long a disarm takes that is asked for during the fault, which ends when it would have
    ended; None: it is not possible."""
    ask_at = min(fault.ask_at, fault.lasts / 2.0) if fault.lasts > 0.0 else fault.ask_at
    fault.begin(dive)
    dive.run(ask_at)
    asked, over, took = dive.now, False, None
    dive.ask(kind="disarm")
    while took is None and (waited := (dive.now - asked) / 1e9) < REQUEST_S:
        if not over and waited >= fault.lasts - ask_at:
            fault.end(dive)
            over = True
        dive.run(LOOK_S)
        took = disarmed(dive.seen, asked, dive.now)
    if not over:
        fault.end(dive)
    return took


# On virtual time.


def fly_virtual(cells: Sequence[FaultCell], workers: int, seed: int = 0) -> Generator[FlownCell]:
    """In the order in which they are finished."""
    found: dict[int, Figures] = {}
    took: dict[int, float | None] = {}
    with ExitStack() as exits:
        modes = dict.fromkeys(cell.mode for cell in cells)
        dives = {mode: exits.enter_context(closing(VirtualDive(mode, seed))) for mode in modes}
        gc.collect()
        gc.freeze()  # copies share what they do not touch
        jobs: list[tuple[tuple[int, bool], Callable[[], Any]]] = []
        for number, cell in enumerate(cells):
            dive = dives[cell.mode]
            jobs += [((number, False), partial(fly, dive, cell))]
            jobs += [((number, True), partial(disarm, dive, cell.fault))]
        for (number, is_disarm), result in in_copies(jobs, workers):
            (took if is_disarm else found)[number] = result
            if number in found and number in took:
                yield FlownCell(cells[number], with_disarm(found[number], took[number]))


def in_copies(
    jobs: Iterable[tuple[Any, Callable[[], Any]]], workers: int
) -> Generator[tuple[Any, Any]]:
    """(key, result) of each job, as they are finished. A copy goes on from the very state of this
    process, which must have one thread.

    Raises:
        RuntimeError: a copy failed; it has said why.
    """
    fork, running = multiprocessing.get_context("fork"), dict[Connection, Any]()

    def finished() -> Generator[tuple[Any, Any]]:
        for pipe in wait(running):
            assert isinstance(pipe, Connection)
            key = running.pop(pipe)
            try:
                yield key, pipe.recv()
            except EOFError:
                raise RuntimeError(f"cell {key} failed") from None

    for key, work in jobs:
        while len(running) >= workers:
            yield from finished()
        mine, theirs = fork.Pipe(duplex=False)
        fork.Process(target=_work, args=(work, theirs)).start()
        theirs.close()
        running[mine] = key
    while running:
        yield from finished()


def _work(work: Callable[[], Any], pipe: Connection) -> None:
    pipe.send(work())


# In real processes: several in one dive, one after the other.


def fly_real() -> Generator[FlownCell]:
    """About ten minutes."""
    faults = of("real")
    killed = [f for f in faults if f.name.startswith("kill -9") and not f.alone]
    stopped = [f for f in faults if f.name.startswith("SIGSTOP")]
    shorter, longer = ([f for f in stopped if (f.lasts > 10.0) == long] for long in (False, True))
    begins = ("cable", "link", "imu silent", "pressure silent", "vertical dead", "port dead")
    others = [f for f in faults if f.name.startswith(begins)]
    took = dict(_disarms(killed + longer))
    for each in (killed, shorter, longer, others, *([f] for f in faults if f.alone)):
        for flown in _in_one_dive(each):
            name, found = flown.cell.fault.name, flown.figures
            yield flown._replace(figures=with_disarm(found, took[name]) if name in took else found)


def _in_one_dive(faults: Sequence[FaultCase]) -> Generator[FlownCell]:
    """What each fault does; the drone stays armed."""
    cells: list[tuple[FaultCell, int, Figures]] = []
    try:
        with real_dive(PILOTED, small=faults[0].name == "disk full") as dive:
            for fault in faults:
                dive.wait_steady()
                begin, cell = dive.now, FaultCell(PILOTED, fault)
                cells.append((cell, begin, _until_recovered(dive, begin, fly(dive, cell, MORE_S))))
            dive.end()
            for cell, begin, found in cells:
                yield FlownCell(cell, found, cell.fault.note(dive, begin))
    except subprocess.CalledProcessError:
        return  # no small disk is allowed here: the page says which cells were flown


def _until_recovered(dive: RealFaultDive, begin: int, found: Figures) -> Figures:
    """The figures when the pilot is in control again, or when that takes too long."""
    while found.recovered is None and dive.now - begin < LONGEST_RECOVERY_S * 1e9:
        if not dive.lindy.alive:
            break
        dive.run(1.0)
        found = figures(dive.seen, begin, dive.now, holds_depth=True)
    return found


def _disarms(faults: Sequence[FaultCase]) -> Generator[tuple[str, float | None]]:
    with real_dive(AT_REST) as dive:
        for fault in faults:
            dive.wait_steady()
            yield fault.name, disarm(dive, fault)
            dive.run(12.0 if any(name in fault.name for name in ONLOOKERS) else 6.0)
            for _ in range(5):
                dive.ask(kind="arm")
                dive.run(2.0)
                if dive.seen.armed:
                    break
