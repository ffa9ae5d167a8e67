"""`lindy ramp`: a reference generator as a filter, CSV in and CSV out, or one plan as JSON."""

import json
import sys
from collections.abc import Iterable, Iterator
from math import floor, inf, isfinite, nan
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
BLANK = "\ufeff \t\r\n"  # spreadsheets like to begin with a byte order mark
TOO_LARGE = "the numbers are too large or too small to calculate with"


def ramp(
    *,
    rule: Rule = "bounded",
    jerk: float | None = None,
    accel: float | None = None,
    dt: float | None = None,
    plan: float | None = None,
) -> int:
    """Turn a stick log into a smooth reference (CSV).

    Stick log on stdin: t,target; reference on stdout: t,x,v,a,j.

    Targets hold until the next one and take effect exactly at their own time, also between
    samples. Samples are at the first input time and every dt from there, the last input time
    included where it falls on one. The sample at which a target changes already shows the new
    plan's jerk; position, velocity and acceleration are continuous there (velocity is not with
    --rule direct). Position, velocity and acceleration start at 0. The filter has 10 rad/s and a
    damping of 0.8.

    Example: printf 't,target\\n0,0.3\\n2,0\\n' | lindy ramp --jerk 3 --accel 0.5 --dt 0.1

    Example: lindy ramp --jerk 3 --plan 0.3

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
    plan
        print one transition to this velocity as JSON instead; reads nothing
    """
    for name, value in (("jerk", jerk), ("accel", accel), ("dt", dt)):
        if value is not None and not (isfinite(value) and value > 0):
            raise LindyError(f"--{name} is {value}, expected a finite number above 0")
    if plan is not None and not isfinite(plan):
        raise LindyError(f"--plan is {plan}, expected a finite number")
    generator = generator_of(rule, jerk, accel)
    if plan is not None:
        print(plan_of(rule, generator, plan))
        return 0
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
    try:
        for number, line in enumerate(source, 1):
            cells = [cell.strip() for cell in line.strip(BLANK).split(",")]
            if not any(cells) or (not rows and cells == HEADER):
                continue
            try:
                t, target = map(float, cells)
            except ValueError:
                t = target = nan
            if not isfinite(t) or not isfinite(target):
                said = f"expected two finite numbers t,target, found {','.join(cells)!r}"
                raise LindyError(f"stdin, line {number}: {said}")
            if rows and t < rows[-1][0]:
                raise LindyError(
                    f"stdin, line {number}: time {t} is before {rows[-1][0]} on the line above; "
                    f"times must not go back"
                )
            rows.append((t, target))
    except UnicodeDecodeError as error:
        raise LindyError(f"stdin is not a CSV file: {error}") from None
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


def generator_of(rule: Rule, jerk: float | None, accel: float | None) -> "BaselineReference":
    from tools.generators import thesis_rule
    from tools.generators.baselines import Direct, Filter, PlannedBaseline, minimum_time

    if accel is not None and rule not in ("bounded", "minimum-time"):
        print(f"lindy: --accel has no effect: --rule {rule} has no such limit", file=sys.stderr)
    if rule in ("direct", "filter"):
        return Direct() if rule == "direct" else Filter()
    if jerk is None:
        raise LindyError(f"--jerk is missing: --rule {rule} needs the most jerk, e.g. --jerk 3")
    limits = Limits(jerk, inf if accel is None else accel)

    def plan(v: float, a: float, target: float) -> list[Segment]:
        if rule == "thesis":
            part = thesis_rule.plan(v, a, target, limits.jerk)
            return [] if part is None else [part]
        return (minimum_time if rule == "minimum-time" else solve)(v, a, target, limits)

    return PlannedBaseline(plan)


def plan_of(rule: Rule, generator: "BaselineReference", to: float) -> str:
    from tools.generators.baselines import PlannedBaseline

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
