"""The figures that are kept of the last run, beside which the next is judged. Pure.

Several runs of a section give one figure, that of the run with the median ratio, and its noise: by
how much the ratios of the runs differ. A figure is judged where both it and the last were measured
while nobody else worked, and where it has a ratio: `Figure` says why only that.
"""

from collections.abc import Iterable, Sequence
from typing import Literal

import msgspec

from lindy_research.bench.table import Figure

QUIET = 0.2  # [cores] that others may take
BEGIN, END = "<!-- figures: written by make bench -->", "<!-- end of figures -->"
HEADS = ("figure", "ours", "beside", "there", "ratio", "goal", "noise")

Verdict = Literal["better", "same", "worse"]


class KeptFigure(msgspec.Struct, frozen=True, kw_only=True):
    """Fields as in `Figure`."""

    section: str
    name: str
    unit: str
    ours: float | None
    baseline_name: str
    baseline: float | None
    goal: float | None
    ratio: float | None
    noise: float  # [-] largest minus smallest ratio of the runs
    runs: int
    others: float  # [cores] that other work took before it was measured
    machine: str

    @property
    def key(self) -> tuple[str, str, str]:
        return self.section, self.name, self.baseline_name

    @property
    def quiet(self) -> bool:
        return self.others <= QUIET


def kept(runs: Sequence[Sequence[Figure]], others: float, machine: str) -> list[KeptFigure]:
    """One figure of several runs of a section.

    Args:
        runs: at least one; a figure need not be in all of them.
        others: [cores] that other work took at most.
    """
    found: dict[tuple[str, str, str], list[Figure]] = {}
    for figure in (figure for run in runs for figure in run):
        found.setdefault((figure.section, figure.name, figure.baseline_name), []).append(figure)
    return [_of_runs(figures, others, machine) for figures in found.values()]


def _of_runs(figures: list[Figure], others: float, machine: str) -> KeptFigure:
    measured = sorted(
        ((ratio, place) for place, each in enumerate(figures) if (ratio := each.ratio) is not None)
    )
    middle = figures[measured[(len(measured) - 1) // 2][1]] if measured else figures[0]
    return KeptFigure(
        section=middle.section,
        name=middle.name,
        unit=middle.unit,
        ours=middle.ours,
        baseline_name=middle.baseline_name,
        baseline=middle.baseline,
        goal=middle.goal,
        ratio=middle.ratio,
        noise=measured[-1][0] - measured[0][0] if measured else 0.0,
        runs=len(figures),
        others=others,
        machine=machine,
    )


def cores_at_work(before: str, after: str, cores: int) -> float:
    """[cores] Between two readings of /proc/stat: proc_stat(5)."""
    first, second = ([int(ticks) for ticks in text.split()[1:9]] for text in (before, after))
    idle, waiting = (second[place] - first[place] for place in (3, 4))
    every = sum(second) - sum(first)
    return cores * (every - idle - waiting) / every if every else 0.0


def compare(old: float, new: float, noise: float) -> Verdict:
    """Ratios, of which the smaller is the better.

    Args:
        noise: difference that says nothing.
    """
    if abs(new - old) <= noise:
        return "same"
    return "worse" if new > old else "better"


def worse(last: Iterable[KeptFigure], now: Iterable[KeptFigure]) -> list[tuple[KeptFigure, ...]]:
    """(the last, this one) of every figure that is worse by more than the noise of both. One run
    knows no noise, and judges nothing."""
    before = {figure.key: figure for figure in last}
    found: list[tuple[KeptFigure, ...]] = []
    for new in now:
        old = before.get(new.key)
        if old is None or old.ratio is None or new.ratio is None:
            continue
        judged = old.quiet and new.quiet and old.machine == new.machine
        judged = judged and min(old.runs, new.runs) > 1
        if judged and compare(old.ratio, new.ratio, old.noise + new.noise) == "worse":
            found.append((old, new))
    return found


def noisier(last: Iterable[KeptFigure], now: Sequence[KeptFigure]) -> bool:
    """Were they measured beside other work, and the last of their section not?"""
    sections = {figure.section for figure in now}
    before = [figure.quiet for figure in last if figure.section in sections]
    return bool(before) and all(before) and not all(figure.quiet for figure in now)


def merged(last: Iterable[KeptFigure], now: Iterable[KeptFigure]) -> list[KeptFigure]:
    """The newest of each section, in its place: of one that was not measured now, the last."""
    before, new = list(last), list(now)
    measured = {figure.section for figure in new}
    found: list[KeptFigure] = []
    for section in dict.fromkeys(figure.section for figure in [*before, *new]):
        of_it = new if section in measured else before
        found += [figure for figure in of_it if figure.section == section]
    return found


def with_table(page: str, figures: Sequence[KeptFigure]) -> str:
    """A page with the figures in place of those between its marks; all else stays.

    Raises:
        ValueError: it has no marks.
    """
    before, found, rest = page.partition(BEGIN)
    _, ended, after = rest.partition(END)
    if not (found and ended):
        raise ValueError(f"there is no {BEGIN!r} with {END!r} behind it")
    return f"{before}{BEGIN}\n\n{_in_sections(figures)}\n\n{END}{after}"


def _in_sections(figures: Sequence[KeptFigure]) -> str:
    """What is missed first."""
    missed = [figure for figure in figures if not _met(figure)]
    parts = ["### Missed goals", _table([(f"{each.section}: ", each) for each in missed])]
    for section in dict.fromkeys(figure.section for figure in figures):
        found = [figure for figure in figures if figure.section == section]
        parts += [f"### {section}", _measured(found[0]), _table([("", each) for each in found])]
    return "\n\n".join(parts)


def _measured(figure: KeptFigure) -> str:
    """How the figures of its section were."""
    runs = "one run" if figure.runs == 1 else f"{figure.runs} runs"
    return f"{figure.machine}; {runs}; other work took {figure.others:.1f} cores."


def _table(figures: Sequence[tuple[str, KeptFigure]]) -> str:
    rows = [HEADS, ("---",) * len(HEADS), *(_cells(before, figure) for before, figure in figures)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _cells(before: str, figure: KeptFigure) -> tuple[str, ...]:
    ratio = _number(figure.ratio, 3)
    return (
        f"{before}{figure.name}",
        _with_unit(figure.ours, figure.unit),
        figure.baseline_name or "–",
        _with_unit(figure.baseline, figure.unit),
        ratio if _met(figure) else f"**{ratio}**",
        _number(figure.goal, 3),
        f"{figure.noise:.2g}" if figure.runs > 1 else "–",
    )


def _met(figure: KeptFigure) -> bool:
    return figure.goal is None or figure.ratio is None or figure.ratio <= figure.goal


def _with_unit(value: float | None, unit: str) -> str:
    return "–" if value is None else f"{_number(value, 4)} {unit}".strip()


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}g}"
