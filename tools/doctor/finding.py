"""One line of what was found, and how it is printed."""

import json
from collections import Counter
from collections.abc import Sequence
from typing import Literal, NamedTuple

Verdict = Literal["ok", "change", "missing"]
VERDICTS: tuple[Verdict, ...] = ("ok", "change", "missing")


class VehicleFinding(NamedTuple):
    verdict: Verdict  # missing: it should be there, and is not
    what: str
    text: str


def fit(findings: Sequence[VehicleFinding]) -> bool:
    return all(finding.verdict == "ok" for finding in findings)


def as_lines(findings: Sequence[VehicleFinding]) -> str:
    """A line for each, and a sum."""
    width = max(len(finding.what) for finding in findings)
    lines = [f"{f.verdict:<8} {f.what:<{width}}  {f.text}" for f in findings]
    counts = Counter(finding.verdict for finding in findings)
    total = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
    return "\n".join([*lines, f"{total}: {'fit' if fit(findings) else 'not fit to be flown'}"])


def as_json(findings: Sequence[VehicleFinding]) -> str:
    found = [finding._asdict() for finding in findings]
    return json.dumps({"fit": fit(findings), "findings": found}, ensure_ascii=False, indent=1)
