"""All faults in all modes on virtual time, on all cores."""

import gc
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, closing
from functools import partial
from typing import NamedTuple

import msgspec

from tests.support.faults.catalogue import FAULTS
from tests.support.faults.copies import Work, in_copies
from tests.support.faults.fault import FaultCase
from tests.support.faults.figures import Figures, disarmed, figures, with_disarm
from tests.support.faults.modes import MODES, FlownMode
from tests.support.faults.virtual_dive import SECOND, VirtualDive

REQUEST_S = 5.0  # [s] for which a request is repeated
AFTER_S = 1.0  # [s] more, for thrusters to come to rest
LOOK_S = 0.1  # [s] between two looks at them


class VirtualCell(NamedTuple):
    mode: FlownMode
    fault: FaultCase


# Fault by fault, so that a run that is broken off has something of every mode.
ALL = tuple(VirtualCell(m, f) for f in FAULTS for m in MODES if f.virtual is not None)


def fly_all(
    cells: Sequence[VirtualCell], workers: int, seed: int = 0
) -> Generator[tuple[VirtualCell, Figures]]:
    """Each cell with its figures, in the order in which they are finished."""
    found: dict[int, Figures] = {}
    off: dict[int, float | None] = {}
    with ExitStack() as exits:
        modes = dict.fromkeys(cell.mode for cell in cells)
        dives = {mode: exits.enter_context(closing(VirtualDive(mode, seed))) for mode in modes}
        gc.collect()
        gc.freeze()  # copies share what they do not touch
        for key, data in in_copies(_jobs(cells, dives), workers):
            number, is_second = divmod(key, 2)
            if is_second:
                off[number] = msgspec.json.decode(data, type=float | None)
            else:
                found[number] = msgspec.json.decode(data, type=Figures)
            if number in found and number in off:
                yield cells[number], with_disarm(found[number], off[number])


def _jobs(
    cells: Sequence[VirtualCell], dives: Mapping[FlownMode, VirtualDive]
) -> Generator[tuple[int, Work]]:
    """Two for each cell: what the fault does, and whether the drone can be disarmed meanwhile. All
    of a mode go on from the same instant."""
    for number, cell in enumerate(cells):
        yield 2 * number, partial(_fly, dives[cell.mode], cell)
        yield 2 * number + 1, partial(_disarm, dives[cell.mode], cell)


def _fly(dive: VirtualDive, cell: VirtualCell) -> bytes:
    begin, fault = dive.now, cell.fault
    _begin(dive, fault)
    dive.run(fault.flown)
    _end(dive, fault)
    dive.run(fault.after)
    measured = figures(dive.seen, begin, dive.now, holds_depth=cell.mode.holds_depth)
    return msgspec.json.encode(measured)


def _disarm(dive: VirtualDive, cell: VirtualCell) -> bytes:
    """Ask during the fault; it ends when it would have ended."""
    fault = cell.fault
    ask_at = min(fault.ask_at, fault.lasts / 2.0) if fault.lasts > 0.0 else fault.ask_at
    _begin(dive, fault)
    dive.run(ask_at)
    asked = dive.now
    dive.ask(kind="disarm")
    ends = fault.lasts - ask_at  # [s] after the request
    took, over = None, False
    while took is None and (waited := (dive.now - asked) / SECOND) < REQUEST_S + AFTER_S:
        if waited >= ends and not over:
            _end(dive, fault)
            over = True
        dive.run(LOOK_S)
        took = disarmed(dive.seen, asked, dive.now)
    return msgspec.json.encode(took)


def _begin(dive: VirtualDive, fault: FaultCase) -> None:
    assert fault.virtual is not None
    fault.virtual.begin(dive)


def _end(dive: VirtualDive, fault: FaultCase) -> None:
    assert fault.virtual is not None
    fault.virtual.end(dive)
