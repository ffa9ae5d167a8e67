"""What a link profile does to a stream of messages, without a network."""

import math
import sys

import numpy as np

from messages import events
from services.tether.link_model import LinkDirection
from services.tether.profile import DirectionProfile

FateRow = tuple[int, float, float | None, str]  # seq, sent [s], arrived [s], reason


def fates(
    leg: DirectionProfile, rate: float, size: int, seconds: float, seed: int
) -> list[FateRow]:
    """What becomes of each of a stream of messages, by seq; one row per copy."""
    line: LinkDirection[int] = LinkDirection(leg, np.random.default_rng(seed))
    entries = [round(n * 1e9 / rate) for n in range(max(1, math.floor(rate * seconds)))]
    rows: list[FateRow] = []

    def settle(now: int) -> None:
        while (due := line.due()) is not None and due <= now:
            while (arrival := line.leave(due)) is not None:
                why = events.DAMAGED.name if arrival.damaged else ""
                rows.append((arrival.item, entries[arrival.item] / 1e9, due / 1e9, why))

    for number, entered in enumerate(entries):
        settle(entered)
        line.enter(number, entered, size)
    settle(sys.maxsize)
    rows += [(number, entries[number] / 1e9, None, why.name) for number, why in line.take_lost()]
    return sorted(rows, key=lambda row: (row[0], row[2] or 0.0))
