"""When nothing at all was recorded, although every service publishes its health once a second."""

import msgspec

HOLE_NS = 1_000_000_000  # [ns] without any message; a usual dive has hundreds in this time
SHOWN = 2  # in words; all are in report.json


class Hole(msgspec.Struct, frozen=True):
    """A time without any message, since the drone was first armed, or, if it never was, since the
    first message."""

    begin: float  # [s]
    end: float  # [s]


class HoleFinder:
    """Shown the time of every message, in the order in which they were recorded."""

    def __init__(self) -> None:
        self.found: list[tuple[int, int]] = []  # [ns]
        self._newest: int | None = None

    def see(self, log_ns: int) -> None:
        newest = self._newest
        if newest is not None and log_ns <= newest:
            return
        if newest is not None and log_ns - newest > HOLE_NS:
            self.found.append((newest, log_ns))
        self._newest = log_ns


def holes(found: list[tuple[int, int]], began_ns: int) -> list[Hole]:
    """
    Args:
        began_ns: [ns] the instant that times in a report count from, by the clock of `found`.
    """
    return [
        Hole(round((begin - began_ns) / 1e9, 2), round((end - began_ns) / 1e9, 2))
        for begin, end in found
    ]


def in_words(found: list[Hole]) -> str:
    """One sentence, the longest first."""
    longest = sorted(found, key=lambda hole: hole.begin - hole.end)
    text = " and ".join(f"from {hole.begin:.1f} to {hole.end:.1f} s" for hole in longest[:SHOWN])
    more = len(found) - SHOWN
    return f"nothing was recorded {text}" + (f", and {more} more times" if more > 0 else "")
