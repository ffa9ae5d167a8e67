"""`lindy ramp`: a reference generator as a filter, CSV in and CSV out, or one plan as JSON."""

import csv
import json
import sys
from collections.abc import Iterable, Iterator
from math import floor, inf, isfinite
from typing import TYPE_CHECKING, Literal, TextIO

from services.reference.trajectory.minimum_jerk import Limits, Sample, Segment, solve
from services.runtime.config.errors import LindyError

if TYPE_CHECKING:
    from tools.generators.baselines import BaselineReference

Rule = Literal["bounded", "thesis", "direct", "filter", "minimum-time"]
TargetRow = tuple[float, float]  # t [s], target

MOST_SAMPLES = 5_000_000
SAME = 1e-9  # of dt: an input closer than this to a sample is at the sample
HEADER = ["t", "target"]
BYTE_ORDER_MARK = "\ufeff"  # spreadsheets like to begin with one
TOO_LARGE = "the numbers are too large or too small to calculate with"


def ramp(
    *,
    rule: Rule = "bounded",
    jerk: float | None = None,
    accel: float | None = None,
    dt: float | None = None,
    v0: float = 0.0,
    a0: float = 0.0,
    frequency: float = 10.0,
    damping: float = 0.8,
    plan: bool = False,
    to: float | None = None,
) -> int:
    """Turn a stick log into a smooth reference (CSV).

    Stick log on stdin: t,target; reference on stdout: t,x,v,a,j.

    Targets hold until the next one and take effect exactly at their own time, also between
    samples. Samples are at the first input time and every dt from there, the last input time
    included where it falls on one. The sample at which a target changes already shows the new
    plan's jerk; position, velocity and acceleration are continuous there (velocity is not with
    --rule direct). Position starts at 0, velocity and acceleration at --v0 and --a0.

    Example: printf 't,target\\n0,0.3\\n2,0\\n' | lindy ramp --jerk 3 --accel 0.5 --dt 0.1

    Example: lindy ramp --jerk 3 --plan --to 0.3

    Parameters
    ----------
    rule
        the law; only bounded keeps to both limits from any state
    jerk
        most jerk [per s³]; direct and filter have none
    accel
        most acceleration [per s²], of bounded and minimum-time
    dt
        [s] between samples
    v0
        velocity at the beginning
    a0
        acceleration at the beginning
    frequency
        [rad/s] of the filter
    damping
        [-] of the filter
    plan
        print one transition as JSON instead; reads nothing
    to
        target velocity of --plan
    """
    _check({"jerk": jerk, "accel": accel, "dt": dt}, {"v0": v0, "a0": a0, "to": to})
    generator = _generator(rule, jerk, accel, v0, a0, frequency, damping)
    if plan:
        print(_plan(rule, generator, to))
        return 0
    if to is not None:
        raise LindyError("--to belongs to --plan; without it the targets come from stdin")
    if dt is None:
        raise LindyError("--dt is missing: the time between samples in seconds, e.g. --dt 0.01")
    rows = read(sys.stdin)
    try:
        lines = [
            f"{t!r},{here.position!r},{here.velocity!r},{here.acceleration!r},{here.jerk!r}\n"
            for t, here in samples(generator, rows, dt)
        ]
    except (ValueError, ArithmeticError):
        raise LindyError(TOO_LARGE) from None
    sys.stdout.write("t,x,v,a,j\n" + "".join(lines))
    return 0


def read(source: TextIO) -> list[TargetRow]:
    """Times and targets of a CSV, with or without the header t,target.

    Raises:
        LindyError: empty, not two finite numbers on a line, or times that go back.
    """
    rows: list[TargetRow] = []
    lines = csv.reader(source)
    try:
        for cells in lines:
            cells = [cell.strip(BYTE_ORDER_MARK).strip() for cell in cells]
            if not any(cells) or (not rows and cells == HEADER):
                continue
            rows.append(_row(cells, lines.line_num))
            if len(rows) > 1 and rows[-1][0] < rows[-2][0]:
                raise LindyError(
                    f"stdin, line {lines.line_num}: time {rows[-1][0]} is before {rows[-2][0]} "
                    "on the line above; times must not go back"
                )
    except (csv.Error, UnicodeDecodeError) as error:
        raise LindyError(f"stdin, line {lines.line_num + 1}: not a CSV file: {error}") from None
    if not rows:
        raise LindyError("stdin holds no targets; expected CSV lines t,target")
    return rows


def samples(
    generator: "BaselineReference", rows: list[TargetRow], dt: float
) -> Iterator[tuple[float, Sample]]:
    """The reference at the first time of `rows`, every dt [s] from there, to the last time."""
    first, last = rows[0][0], rows[-1][0]
    count = (last - first) / dt
    if not count < MOST_SAMPLES:
        raise LindyError(
            f"--dt {dt} makes {count:.3g} samples of {last - first} s; the most is 5e6"
        )
    due = iter([*rows, (inf, 0.0)])
    time, target = next(due)
    for k in range(floor(count + SAME) + 1):
        t = first + k * dt
        while time <= t + SAME * dt:
            generator.aim(target, time)
            t = time if abs(time - t) <= SAME * dt else t
            time, target = next(due)
        here = generator.at(t)
        if not all(map(isfinite, here)):
            raise LindyError(f"{TOO_LARGE}, at t = {t}")
        yield t, here


def _row(cells: list[str], line: int) -> TargetRow:
    if len(cells) != 2:
        raise LindyError(f"stdin, line {line}: expected t,target, found {','.join(cells)!r}")
    try:
        t, target = float(cells[0]), float(cells[1])
    except ValueError:
        raise LindyError(
            f"stdin, line {line}: expected two numbers t,target, found {','.join(cells)!r}"
        ) from None
    if not (isfinite(t) and isfinite(target)):
        raise LindyError(f"stdin, line {line}: numbers must be finite, found {','.join(cells)!r}")
    return t, target


def _check(above_0: dict[str, float | None], finite: dict[str, float | None]) -> None:
    for name, value in above_0.items():
        if value is not None and not (isfinite(value) and value > 0):
            raise LindyError(f"--{name} is {value}, expected a finite number above 0")
    for name, value in finite.items():
        if value is not None and not isfinite(value):
            raise LindyError(f"--{name} is {value}, expected a finite number")


def _generator(
    rule: Rule, jerk: float | None, accel: float | None, v0: float, a0: float,
    frequency: float, damping: float,
) -> "BaselineReference":  # fmt: skip
    from tools.generators import thesis_rule
    from tools.generators.baselines import Direct, Filter, PlannedBaseline, minimum_time

    if accel is not None and rule not in ("bounded", "minimum-time"):
        print(f"lindy: --accel has no effect: --rule {rule} has no such limit", file=sys.stderr)
    if rule == "direct":
        return Direct(target=v0)
    if rule == "filter":
        _check({"frequency": frequency, "damping": damping}, {})
        return Filter(frequency, damping, velocity=v0, acceleration=a0, target=v0)
    if jerk is None:
        raise LindyError(f"--jerk is missing: --rule {rule} needs the most jerk, e.g. --jerk 3")
    limits = Limits(jerk, inf if accel is None else accel)

    def plan(v: float, a: float, target: float) -> list[Segment]:
        if rule == "thesis":
            part = thesis_rule.plan(v, a, target, limits.jerk)
            return [] if part is None else [part]
        return (minimum_time if rule == "minimum-time" else solve)(v, a, target, limits)

    return PlannedBaseline(plan, velocity=v0, acceleration=a0)


def _plan(rule: Rule, generator: "BaselineReference", to: float | None) -> str:
    from tools.generators.baselines import PlannedBaseline

    if to is None:
        raise LindyError("--to is missing: the velocity that --plan goes to, e.g. --to 0.3")
    if not isinstance(generator, PlannedBaseline):
        raise LindyError(f"--plan has nothing to show with --rule {rule}, which makes no plan")
    try:
        generator.aim(to, 0.0)
        parts = generator.segments
        report = {
            "T": sum(part.duration for part in parts),
            "peak_accel": _peak_acceleration(parts),
            # The jerk is linear between the ends of a part.
            "peak_jerk": max(
                (abs(j) for p in parts for j in (p.j0, p.at(p.duration).jerk)), default=0.0
            ),
            "displacement": sum(part.at(part.duration).position for part in parts),
            "segments": [
                dict(zip(("T", "v0", "a0", "j0", "half_snap"), part, strict=True)) for part in parts
            ],
        }
        return json.dumps(report, allow_nan=False)
    except (ValueError, ArithmeticError):
        raise LindyError(TOO_LARGE) from None


def _peak_acceleration(parts: Iterable[Segment]) -> float:
    peak = 0.0
    for part in parts:
        times = [0.0, part.duration]
        if part.half_snap != 0:
            times.append(-part.j0 / (2 * part.half_snap))
        inside = (t for t in times if 0 <= t <= part.duration)
        peak = max(peak, *(abs(part.at(t).acceleration) for t in inside))
    return peak
