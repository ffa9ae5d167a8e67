"""What Andrén 2023 says of its experiments, section 6.2, against the whole stack in simulation.

The thesis prints no numbers for them but one, so most claims are comparisons: a ratio of ramped to
naive that should be below 1, or an overshoot that should be none.
"""

from collections.abc import Callable, Iterator
from statistics import fmean

from lindy_research.papers import full_stack_energy as energy
from lindy_research.papers.claims import Claim, judged
from lindy_research.papers.full_stack_runs import (
    DEPTH,
    HEADING,
    SEEDS,
    StepRun,
    StepScores,
    flown,
    idle,
    pitching,
    scores,
)
from lindy_research.papers.identified_battery import hotel_power

NOTE = f"simulated Pioneer, whole stack, mean of {len(SEEDS)} seeds; no number is printed"
NO_OVERSHOOT = (0.015, 0.1)  # [m], [deg] no more than the noise of holding still


def full_stack_claims() -> list[Claim]:
    return [*_depth(), *_heading(), *_pitch(), *_battery()]


def _depth() -> Iterator[Claim]:
    source, naive, jerky = "Andrén 2023, 6.2.1", *_both(_depth_scores)
    yield judged("andren-6.5-overshoot", source, "the position overshoots with the direct method",
                 0, naive.overshoot, "m", 0.0, "more than", note=NOTE)  # fmt: skip
    yield from _lower("6.6", source, "the overshoot in position is smaller", "overshoot",
                      jerky.overshoot / naive.overshoot)  # fmt: skip
    yield from _lower("6.6", source, "less lag: largest position error", "error",
                      jerky.error / naive.error)  # fmt: skip
    yield from _lower("6.6", source, "less jerk: squared changes of thrust", "jerk",
                      jerky.jerk / naive.jerk)  # fmt: skip
    yield from _lower("6.6", source, "lower peak force", "peak", jerky.peak / naive.peak)
    yield judged("andren-6.6-stops", source, "it stops accurately: overshoot",
                 0, jerky.overshoot, "m", NO_OVERSHOOT[0], "at most", note=NOTE)  # fmt: skip
    yield from _lower("6.6", source, "it stops sooner: time until within 20 mm for good",
                      "settled", jerky.settled / naive.settled)  # fmt: skip


def _heading() -> Iterator[Claim]:
    source, naive, jerky = "Andrén 2023, 6.2.2", *_both(_heading_scores)
    yield from _lower("6.8", source, "lower peak moment", "peak", jerky.peak / naive.peak)
    yield from _lower("6.8", source, "less aggressive: squared changes of moment", "jerk",
                      jerky.jerk / naive.jerk)  # fmt: skip
    yield from _lower("6.8", source, "largest heading error", "error", jerky.error / naive.error)
    yield judged("andren-6.8-overshoot", source, "it stops without overshoot",
                 0, jerky.overshoot, "°", NO_OVERSHOOT[1], "at most",
                 note=f"naive {naive.overshoot:.1f}°; {NOTE}")  # fmt: skip
    yield from _lower(
        "6.8", source, "it stops faster: time until within 0.5° for good", "settled",
        jerky.settled / naive.settled,
        why=f"naive is there {naive.settled:.2f} s after the release, overshoot and all, with "
        f"ramps {jerky.settled:.2f} s: the ramp itself takes most of that, and this heading loop "
        "is quick and well damped",
    )  # fmt: skip
    yield from _lower("6.8", source, "error left at rest, by the estimate", "left",
                      jerky.left / naive.left)  # fmt: skip
    at_rest = [flown(seed, naive=False) for seed in SEEDS]
    down, round_ = (fmean(map(idle, axes)) for axes in (
        [dive.depth for dive in at_rest], [dive.heading for dive in at_rest]))  # fmt: skip
    yield judged("andren-6.8-dead-band", source,
                 "the dead-band matters less in depth, which buoyancy biases: time at rest without "
                 "thrust in depth, of that in heading", 1, down / round_, "-", 0.0, "at most",
                 note=f"{down:.0f} % and {round_:.0f} %; {NOTE}")  # fmt: skip


def _pitch() -> Iterator[Claim]:
    naive, jerky = _mean(pitching, naive=True), _mean(pitching, naive=False)
    yield from _lower("6.6", "Andrén 2023, 6.2.1",
                      "less pitching when the depth is changed under way, rms pitch rate",
                      "pitch", jerky / naive)  # fmt: skip


def _battery() -> Iterator[Claim]:
    naive, jerky = energy.used(naive=True), energy.used(naive=False)
    yield judged(
        "andren-6.2.3-battery-dive", "Andrén 2023, 6.2.3",
        "the battery lasts longer by 10 to 20 %, on a dive", 15, energy.longer(), "%", 5.0,
        why=f"of the {naive.thrusters[-1]:.0f} J that the thrusters take without ramps, "
        f"{naive.pushing:.0f} J go into running ahead and pushing against floor and surface, "
        f"{jerky.pushing:.0f} J with ramps; {hotel_power():.0f} W for all else do not change",
        note=f"{energy.DIVE}, whole stack, electrical power as simulated; thrusters alone take "
        f"{energy.thruster_share():.3f} times as much without ramps",
    )  # fmt: skip


def _lower(
    figure: str, source: str, claim: str, name: str, ratio: float, why: str = ""
) -> Iterator[Claim]:
    yield judged(
        f"andren-{figure}-{name}", f"{source} and figure {figure}", f"{claim}, of the naive one",
        1, ratio, "-", 0.0, "at most", why, NOTE,
    )  # fmt: skip


def _both(of: Callable[[StepRun], StepScores]) -> tuple[StepScores, StepScores]:
    """Naive and ramped, each the mean over the seeds."""
    naive, jerky = (
        StepScores(*map(fmean, zip(*[of(flown(seed, naive=each)) for seed in SEEDS], strict=True)))
        for each in (True, False)
    )
    return naive, jerky


def _mean(of: Callable[[StepRun], float], *, naive: bool) -> float:
    return fmean(of(flown(seed, naive=naive)) for seed in SEEDS)


def _depth_scores(dive: StepRun) -> StepScores:
    return scores(dive.depth, DEPTH)


def _heading_scores(dive: StepRun) -> StepScores:
    return scores(dive.heading, HEADING)
