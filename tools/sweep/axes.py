"""The axes of a sweep as the command line gives them, and their product."""

import re
from collections.abc import Iterator, Sequence
from itertools import product
from math import prod
from typing import NamedTuple

import msgspec

from services.runtime.config.errors import LindyError

MOST_DIVES = 1_000_000
SEEDS = re.compile(r"(\d+)(?:\.\.(\d+))?")
OPENING, CLOSING = "[{(", "]})"


class Combination(NamedTuple):
    """One value of every axis but the seed."""

    vehicle: str
    link: str
    pilot: str
    settings: tuple[str, ...]  # key.path=value


class PlannedDive(NamedTuple):
    number: int  # in the product, from 0
    combination: Combination
    seed: int


class SweepAxes(msgspec.Struct, frozen=True):
    """The values of each axis, in the order of the command line."""

    vehicle: tuple[str, ...]
    link: tuple[str, ...]
    pilot: tuple[str, ...]
    settings: dict[str, tuple[str, ...]]  # key.path → values
    seed: tuple[int, ...]

    def combinations(self) -> list[Combination]:
        assigned = [[f"{key}={v}" for v in values] for key, values in self.settings.items()]
        return [
            Combination(vehicle, link, pilot, settings)
            for vehicle, link, pilot in product(self.vehicle, self.link, self.pilot)
            for settings in product(*assigned)
        ]

    def dives(self) -> Iterator[PlannedDive]:
        """All dives, each with its number."""
        every = product(self.combinations(), self.seed)
        return (PlannedDive(n, combination, seed) for n, (combination, seed) in enumerate(every))

    @property
    def count(self) -> int:
        lengths = map(len, (self.vehicle, self.link, self.pilot, self.seed))
        return prod(lengths) * prod(map(len, self.settings.values()))

    @property
    def varied(self) -> list[str]:
        """Names of the axes with more than one value, without the seed."""
        named = {"vehicle": self.vehicle, "link": self.link, "pilot": self.pilot, **self.settings}
        return [name for name, values in named.items() if len(values) > 1]


def axes(
    vehicle: Sequence[str],
    link: Sequence[str],
    pilot: Sequence[str],
    settings: Sequence[str],
    seed: Sequence[str],
) -> SweepAxes:
    """Read the options; each may be given several times, and has values with commas between them.

    Raises:
        LindyError: a value is empty or there twice, a key is set twice, a seed is none, or the
            dives are too many.
    """
    found = SweepAxes(
        vehicle=_values("--vehicle", vehicle),
        link=_values("--link", link),
        pilot=_values("--pilot", pilot),
        settings=_settings(settings),
        seed=tuple(_seeds(seed)),
    )
    if found.count > MOST_DIVES:
        raise LindyError(f"these axes make {found.count} dives; the most is {MOST_DIVES}")
    return found


def _values(option: str, texts: Sequence[str]) -> tuple[str, ...]:
    values = [value for text in texts for value in _split(text)]
    for value in values:
        if not value:
            between = "" if option.endswith("=") else " "
            raise LindyError(f"{option}{between}{','.join(texts)}: a value is empty")
        if values.count(value) > 1:
            raise LindyError(f"{option} names {value} twice")
    return tuple(values)


def _settings(assignments: Sequence[str]) -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {}
    for assignment in assignments:
        key, equals, text = (part.strip() for part in assignment.partition("="))
        if not equals or not key:
            raise LindyError(f"--set {assignment}: expected key.path=value or key.path=value,value")
        if key in found:
            raise LindyError(f"--set {key} is there twice; write --set {key}=value,value")
        found[key] = _values(f"--set {key}=", [text])
    return found


def _split(text: str) -> list[str]:
    """At the commas that are not inside brackets or quotes, so that a value may be an array."""
    parts, depth, quote = [""], 0, ""
    for character in text:
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'":
            quote = character
        elif character in OPENING:
            depth += 1
        elif character in CLOSING:
            depth -= 1
        if character == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def _seeds(texts: Sequence[str]) -> list[int]:
    """`7`, `1,2,5` and `1..100`, the last included."""
    seeds: dict[int, None] = {}
    for part in [part for text in texts for part in _split(text)]:
        match = SEEDS.fullmatch(part)
        if match is None:
            raise LindyError(f"--seed {part!r}: expected whole numbers from 0: 7, 1,2,5 or 1..100")
        first, last = int(match[1]), int(match[2] or match[1])
        if last < first:
            raise LindyError(f"--seed {part} goes backwards; write {last}..{first}")
        if last - first >= MOST_DIVES:
            raise LindyError(f"--seed {part} makes {last - first + 1} dives; most: {MOST_DIVES}")
        for seed in range(first, last + 1):
            if seed in seeds:
                raise LindyError(f"--seed names {seed} twice")
            seeds[seed] = None
    return list(seeds)
