"""Numeric claims of the papers beside our own values, each judged by a stated tolerance."""

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Literal

import msgspec

Comparison = Literal["equal", "at most", "more than"]
Verdict = Literal["holds", "differs", "not computed"]
Value = float | Sequence[float]
UNEXPECTED = "not expected: our value is outside the stated tolerance"


class Claim(msgspec.Struct, frozen=True):
    """A number of a paper and the same number from our code."""

    id: str
    source: str  # paper, section or equation or figure
    claim: str
    paper: list[float]  # as printed
    ours: list[float]  # computed here; empty where it was not
    unit: str
    comparison: Comparison  # ours is this to the paper's
    tolerance: float  # in the unit, for each value
    verdict: Verdict
    why: str  # where it differs
    note: str  # what the paper leaves open and we chose


def judged(
    id_: str, source: str, claim: str, paper: Value, ours: Value, unit: str, tolerance: float,
    comparison: Comparison = "equal", why: str = "", note: str = "",
) -> Claim:  # fmt: skip
    """A claim with its verdict; `why` is kept only where the values differ.

    Raises:
        ValueError: the two have not the same number of values, or one is not finite.
    """
    printed, found = _listed(paper), _listed(ours)
    if len(printed) != len(found) or not all(map(isfinite, (*printed, *found, tolerance))):
        raise ValueError(f"{id_}: {printed} cannot be compared with {found}")
    pairs = zip(printed, found, strict=True)
    verdict = "holds" if all(agree(p, o, comparison, tolerance) for p, o in pairs) else "differs"
    reason = "" if verdict == "holds" else why or UNEXPECTED
    return Claim(
        id_, source, claim, printed, found, unit, comparison, tolerance, verdict, reason, note
    )


def not_computed(id_: str, source: str, claim: str, paper: float, unit: str, note: str) -> Claim:
    """An upper limit that takes too long to look at on every run; `note` says when it is."""
    return Claim(id_, source, claim, [paper], [], unit, "at most", 0.0, "not computed", "", note)


def agree(paper: float, ours: float, comparison: Comparison, tolerance: float) -> bool:
    """Whether one value bears the other out."""
    if comparison == "equal":
        return abs(ours - paper) <= tolerance
    if comparison == "at most":
        return ours <= paper + tolerance
    return ours > paper - tolerance


def write(claims: Sequence[Claim], path: Path) -> None:
    """As JSON.

    Raises:
        OSError: the file cannot be written.
    """
    path.write_bytes(msgspec.json.format(msgspec.json.encode(claims), indent=2) + b"\n")


def table(claims: Sequence[Claim]) -> list[str]:
    """How many hold, which differ and why, and how many were not looked at."""
    differing = [claim for claim in claims if claim.verdict == "differs"]
    holding = sum(claim.verdict == "holds" for claim in claims)
    lines = [f"claims: {holding} hold, {len(differing)} differ"]
    width = max((len(claim.id) for claim in differing), default=0)
    for claim in differing:
        values = f"paper {_shown(claim.paper)}, ours {_shown(claim.ours)} {claim.unit}"
        lines.append(f"  {claim.id:{width}}  {values}: {claim.why}")
    if left := len(claims) - holding - len(differing):
        lines.append(f"{left} of flights not computed, since no figure of theirs is drawn")
    return lines


def _listed(value: Value) -> list[float]:
    if isinstance(value, Sequence):
        return [float(part) for part in value]
    return [float(value)]


def _shown(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.9g}" for value in values)
