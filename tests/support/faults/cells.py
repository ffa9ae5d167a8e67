"""The cells: all faults in all modes on virtual time, on all cores. Each is flown by a copy (fork)
of a process with an armed dive, from one instant on.
"""

import gc
import multiprocessing
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from tests.support.faults.catalogue import FAULTS, MODES, FaultCase, FlownMode
from tests.support.faults.figures import Figures, disarmed, figures, with_disarm
from tests.support.faults.virtual_dive import VirtualDive

REQUEST_S = 6.0  # [s] for which a request is repeated, and thrusters come to rest
LOOK_S = 0.1  # [s] between two looks at them


class FaultCell(NamedTuple):
    mode: FlownMode
    fault: FaultCase


class FlownCell(NamedTuple):
    cell: FaultCell
    figures: Figures


# Fault by fault, so that a run that is broken off has something of every mode.
CELLS = tuple(FaultCell(mode, fault) for fault in FAULTS for mode in MODES)


def fly(dive: VirtualDive, cell: FaultCell) -> Figures:
    """Let a fault happen, and measure what the drone does."""
    begin, fault = dive.now, cell.fault
    fault.begin(dive)
    dive.run(fault.flown)
    fault.end(dive)
    dive.run(fault.after)
    return figures(dive.seen, begin, dive.now, holds_depth=cell.mode.holds_depth)


def disarm(dive: VirtualDive, fault: FaultCase) -> float | None:
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


def fly_all(cells: Sequence[FaultCell], workers: int, seed: int = 0) -> Generator[FlownCell]:
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
