"""What Andrén 2023 says in numbers about its simulations, section 6.1."""

from collections.abc import Iterator

import numpy as np

from lindy_research.papers.claims import Claim, judged
from lindy_research.papers.identified_battery import hotel_power, longer, speed_for, thruster_energy
from lindy_research.papers.identified_inputs import LOG_END, LOG_FULL, SPEED, STEP_ON
from lindy_research.papers.identified_plant import END_JERK, Sums, ratios, rise_time, sums
from lindy_research.papers.identified_runs import (
    NAIVE,
    best_share,
    equal_rise_jerk,
    expected_sums,
    overshoot,
    run,
)
from lindy_research.papers.thesis_tables import PRINTED

UNITS = ("N", "m²", "N²", "N²/s²")
PLANT = "plant, gains and end jerk are not printed but identified from this table; three sines"
LOG = "the log is not printed; ours is chosen from many random ones because it fits; average noise"
IDENTIFIED, LOGGED = 0.03, 0.12  # [-] of the printed value


def simulation_claims() -> list[Claim]:
    """Both tables, and what the text says beside them."""
    return [*_step(), *_table_6_2(), *_feed_forward(), *_rise_time(), *_battery()]


def _cells(table: str, naive: Sums, jerky: Sums, within: float, note: str) -> Iterator[Claim]:
    """Each number of a table."""
    printed = PRINTED["step" if table == "6.1" else "log"]
    for way, paper, ours in (("naive", printed[0], naive), ("minimum jerk", printed[1], jerky)):
        for row, name in enumerate(Sums._fields):
            yield judged(f"andren-table-{table}-{way.replace(' ', '-')}-{name}",
                         f"Andrén 2023, Table {table}", f"{name}, {way}", paper[row], ours[row],
                         UNITS[row], within * paper[row], note=note)  # fmt: skip


def _step() -> Iterator[Claim]:
    naive, jerky = sums(run(NAIVE)), sums(run(END_JERK))
    yield from _cells("6.1", naive, jerky, IDENTIFIED, PLANT)
    paper, ours = ratios(*PRINTED["step"]), ratios(naive, jerky)
    source = "Andrén 2023, 6.1.1 and Table 6.1"
    for row, name in enumerate(Sums._fields):
        yield judged(f"andren-table-6.1-ratio-{name}", source, f"{name}, naive over minimum jerk",
                     paper[row], ours[row], "-", IDENTIFIED * paper[row], note=PLANT)  # fmt: skip
    still = {jerk: expected_sums(jerk, "step") for jerk in (NAIVE, equal_rise_jerk())}
    slow, quick = (rise_time(run(j, disturbed=False), STEP_ON) for j in (END_JERK, NAIVE))
    yield judged(
        "andren-table-6.1-equal-rise", source, "the same four ratios, at equal rise time",
        paper, ratios(*still.values()), "-", 0.1,
        why=f"the printed ratios compare a rise of {slow:.2f} s with one of {quick:.2f} s; peak "
        "and thrust fall because the motion is slower, position error and jerk also at equal rise",
        note=f"end jerk {equal_rise_jerk():.4f} m/s³; average over random noise",
    )  # fmt: skip
    undisturbed = [run(jerk, disturbed=False) for jerk in (NAIVE, END_JERK)]
    ends = [float(each.reference[-1, 0]) for each in undisturbed]
    yield judged("andren-6.1-same-end", "Andrén 2023, 6.1.1", "both references end at one place, "
                 "difference", 0, ends[0] - ends[1], "m", 1e-9)  # fmt: skip
    beyond = [float(np.max(each.position)) - ends[0] for each in undisturbed]
    yield judged("andren-6.1-naive-overshoot", "Andrén 2023, 6.1.1",
                 "the naive reference makes the position overshoot by more than",
                 0, beyond[0], "m", 0.0, "more than", note="without disturbance")  # fmt: skip
    yield judged("andren-6.1-overshoot", "Andrén 2023, 6.1.1",
                 "overshoot of the position that is caused by the minimum-jerk transition",
                 0, beyond[1], "m", 1e-3, note="without disturbance")  # fmt: skip


def _table_6_2() -> Iterator[Claim]:
    naive, jerky = expected_sums(NAIVE, "log"), expected_sums(END_JERK, "log")
    yield from _cells("6.2", naive, jerky, LOGGED, LOG)
    found = ratios(naive, jerky)
    source = "Andrén 2023, 6.1.4"
    text = (
        ("jerk", "jerk is this many times smaller", 40, found.jerk, 5.0),
        ("position", "position error is this many times smaller", 10, found.position, 1.0),
        ("thrust", "squared thrust is this many times smaller", 2, found.thrust, 0.25),
    )
    for name, words, paper, ours, tolerance in text:
        yield judged(f"andren-6.4-{name}", source, words, paper, ours, "-", tolerance, note=LOG)


def _feed_forward() -> Iterator[Claim]:
    source = "Andrén 2023, 6.1.2"
    others = ", ".join(f"{best_share('thrust', jerk):.2f} for {jerk:g}" for jerk in (0.3, 1.0, 3.0))
    yield judged("andren-6.2-least-thrust", source, "share of feed-forward with the least thrust",
                 75, 100 * best_share("thrust"), "%", 2.5,
                 note=f"it is this end jerk's: {others} m/s³")  # fmt: skip
    yield judged("andren-6.2-perfect", source, "share of feed-forward with the least error",
                 100, 100 * best_share("position"), "%", 0.5,
                 note="not 100 % exactly, because the force is held in each step")  # fmt: skip
    none, half, full = (run(share=share) for share in (0.0, 0.5, 1.0))
    uneven = max(
        float(np.max(np.abs(getattr(none, of) + getattr(full, of) - 2 * getattr(half, of))))
        for of in ("velocity", "thrust", "error")
    )
    yield judged("andren-6.2-linear", source, "results are spaced as the shares are, deviation",
                 0, uneven, "m/s, N, m", 1e-9)  # fmt: skip
    late = [sums(run(share=share, disturbed=False)).position for share in (0.6, 0.0)]
    yield judged("andren-6.2-sixty", source, "60 % is still a help: squared error, of that at 0 %",
                 1, late[0] / late[1], "-", 0.0, "at most")  # fmt: skip


def _rise_time() -> Iterator[Claim]:
    source = "Andrén 2023, 6.1.3 and figure 6.3"
    jerk = equal_rise_jerk()
    naive, same = (run(each, disturbed=False) for each in (NAIVE, jerk))
    yield judged("andren-6.3-equal-rise", source, "end jerk with the naive rise time",
                 3, jerk, "m/s³", 0.1, note="rise to 90 %, without disturbance")  # fmt: skip
    yield judged("andren-6.3-equal-peak", source, "peak thrust then, of the naive one",
                 1, sums(same).peak / sums(naive).peak, "-", 0.05)  # fmt: skip
    worst = max(overshoot(run(k / 2, disturbed=False).velocity, SPEED) for k in range(1, 21))
    yield judged("andren-6.3-overshoot", source,
                 "overshoot of the velocity, end jerks from 0.5 to 10 m/s³",
                 0, 100 * worst, "%", 1.0,
                 note=f"naive {100 * overshoot(naive.velocity, SPEED):.1f} %")  # fmt: skip


def _battery() -> Iterator[Claim]:
    naive, jerky = (float(thruster_energy(jerk)[-1]) / LOG_END for jerk in (NAIVE, END_JERK))
    speeds = [LOG_FULL * speed_for(percent, naive, jerky) for percent in (10.0, 20.0)]
    yield judged(
        "andren-6.2.3-battery", "Andrén 2023, 6.2.3", "the battery lasts longer by 10 to 20 %",
        15, longer(naive, jerky), "%", 5.0,
        why=f"on this log thrusters take {naive:.2f} W instead of {jerky:.2f} W, beside "
        f"{hotel_power():.0f} W that do not change",
        note=f"thrust to the power 1.5; one axis. Driven faster it holds: 10 % at full stick "
        f"{speeds[0]:.2f} m/s, 20 % at {speeds[1]:.2f} m/s",
    )  # fmt: skip
    yield judged("andren-6.4-energy", "Andrén 2023, 6.1.1 and 6.1.4",
                 "electricity for thrust, halved like the squared thrust",
                 2, naive / jerky, "-", 0.25,
                 why="power grows with thrust to 1.5, not 2, and gentle parts cost the same",
                 note=LOG)  # fmt: skip
