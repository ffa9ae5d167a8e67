"""Dives of one combination in a worker, stepped together; and the batches of a sweep."""

import time
from collections import defaultdict
from collections.abc import Iterable
from typing import NamedTuple, cast

from services.runtime.config.stack import Stack
from services.tether.io.profile_file import named
from tools.checks import pilot_of
from tools.report import Report
from tools.sweep.all_cores import asked_to_stop
from tools.sweep.axes import Combination, PlannedDive
from tools.sweep.fast.coverage import script_of
from tools.sweep.fast.dives import DiveSettings, fly
from tools.sweep.rows import CLEAN, FLOWN, OF_MESSAGES, Flown, Row, row_of

MOST = 500  # dives; an instant of so many costs twice that of a few
MOST_SECONDS = 45_000.0  # [s] of dives together: tracks of 150 MB
ROUNDS = 2  # batches for each worker, so that there is something to tell on the way
LEAST = 50  # dives; fewer cost as much


class DiveBatch(NamedTuple):
    """Dives with the same settings."""

    dives: tuple[PlannedDive, ...]
    seconds: float | None  # [s] after arming


class FlownBatch(NamedTuple):
    rows: list[Row]
    left: list[PlannedDive]  # what happened in them the arrays do not know


def batches(dives: Iterable[PlannedDive], seconds: float | None, workers: int) -> list[DiveBatch]:
    """Of all dives, as many together as there are for each worker."""
    by_combination = defaultdict[Combination, list[PlannedDive]](list)
    for dive in dives:
        by_combination[dive.combination].append(dive)
    whole = sum(map(len, by_combination.values()))
    size = max(LEAST, min(MOST, -(-whole // (workers * ROUNDS))))
    found = list[DiveBatch]()
    for combination, these in by_combination.items():
        lasts = [pilot_of(combination.pilot).script_s, seconds]
        longest = min(length for length in lasts if length is not None)
        count = -(-len(these) // max(1, min(size, int(MOST_SECONDS / max(1.0, longest)))))
        found += [DiveBatch(tuple(these[k::count]), seconds) for k in range(count)]
    return found


def settings_of(combination: Combination, seconds: float | None) -> DiveSettings:
    pilot = pilot_of(combination.pilot)
    stack = Stack(
        vehicle=combination.vehicle,
        link=combination.link,
        pilot=pilot.name,
        overrides=list(combination.settings),
        seconds=seconds,
        virtual=True,
    )
    return DiveSettings.of(stack, named(combination.link).profile, script_of(pilot.name))


def fly_batch(batch: DiveBatch) -> FlownBatch | None:
    """The rows of its dives; None: it was interrupted."""
    began = time.perf_counter()
    settings = settings_of(batch.dives[0].combination, batch.seconds)
    tracks = fly(settings, [dive.seed for dive in batch.dives], lambda _: not asked_to_stop())
    if tracks is None:
        return None
    kept = [lane for lane, lost in enumerate(tracks.lost) if not lost]
    figures = {lane: tracks.figures(lane) for lane in kept}
    each_s = (time.perf_counter() - began) / len(batch.dives)
    rows = list[Row]()
    for lane, found in figures.items():
        # The columns of motion ask for nothing else of a report.
        flown = Flown(cast(Report, found), tracks.deepest(lane))
        row = row_of(batch.dives[lane], flown, CLEAN, each_s, "", fast=True)
        rows.append(row | {FLOWN: "fast"})
    return FlownBatch(rows, [batch.dives[lane] for lane, lost in enumerate(tracks.lost) if lost])


def killed_batch(batch: DiveBatch) -> FlownBatch | None:
    """A batch whose worker was killed each time is flown dive by dive."""
    return FlownBatch([], list(batch.dives))


def exact_row(row: Row) -> Row:
    """Of a dive that was flown exactly, in the table of a fast sweep."""
    return {key: cell for key, cell in row.items() if key not in OF_MESSAGES} | {FLOWN: "exact"}
