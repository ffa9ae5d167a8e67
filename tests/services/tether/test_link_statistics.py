"""Delays and losses of a link have the distributions of their names, or those of a trace."""

from collections.abc import Callable
from math import log, sqrt
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import events
from messages.events import Row
from services.tether.link_model import LinkDirection
from services.tether.profile import (
    Delays,
    DirectionProfile,
    Drawn,
    Exponential,
    Floats,
    Late,
    Loss,
    Losses,
    Pareto,
    Table,
    Trace,
)
from services.tether.profile import UniformStream as Numbers

ms = st.floats(0.0, 300.0) | st.floats(0.0, 2.0) | st.just(0.0)
share = st.floats(1e-9, 1.0 - 1e-9)
MINUTE_MS = 60_000.0  # longer than this no message takes


@given(st.floats(0.0, 100.0), st.none() | st.floats(0.0, 60.0), st.floats(0.0, 1e4))
def test_a_trace_of_one_row_is_that_for_ever(
    sent: float, later: float | None, seconds: float
) -> None:
    found = Trace("", (sent,), (None if later is None else sent + later,)).at(seconds)
    assert found == (None if later is None else pytest.approx(1e3 * later, abs=1e-6))


def by_table(values: list[float]) -> Callable[[float], float]:
    """Between the measured values, which lie at equal shares from the least to the greatest."""
    ordered = sorted(values)

    def quantile(u: float) -> float:
        k = min(int(u * (len(ordered) - 1)), len(ordered) - 2)
        return ordered[k] + (u * (len(ordered) - 1) - k) * (ordered[k + 1] - ordered[k])

    return quantile


@st.composite
def spreads(draw: st.DrawFn) -> tuple[Drawn, Callable[[float], float]]:
    """A distribution and its quantile function, from its textbook formula."""
    one, shape = draw(ms), draw(st.floats(1.5, 8.0))
    values = draw(st.lists(ms, min_size=2, max_size=6))
    return draw(
        st.sampled_from(
            [
                (Exponential(one), lambda u: one * log(1.0 / (1.0 - u))),
                (
                    Pareto(one, shape),
                    lambda u: one * (shape - 1.0) * (1.0 / (1.0 - u) ** (1.0 / shape) - 1.0),
                ),
                (Table(tuple(values)), by_table(values)),
            ]
        )
    )


@given(spreads(), st.lists(share, min_size=1, max_size=8))
def test_quantiles_are_those_of_the_formula(
    spread: tuple[Drawn, Callable[[float], float]], shares: list[float]
) -> None:
    law, formula = spread
    found = law.quantile(np.array(shares)).tolist()
    assert found == pytest.approx([formula(u) for u in shares], rel=1e-6, abs=1e-6)


class Extreme:
    """Random numbers that are all the same."""

    def __init__(self, number: float) -> None:
        self.number = number

    def random(self, count: int) -> Floats:
        return np.full(count, self.number)


@given(spreads(), st.sampled_from([0.0, 1e-12, 1.0 - 2.0**-53, 1.0 - 1e-12]))
def test_the_rarest_draw_is_that_of_one_in_a_thousand_million(
    spread: tuple[Drawn, Callable[[float], float]], number: float
) -> None:
    law, formula = spread
    delays = Delays(law, cast(np.random.Generator, Extreme(number)))
    rarest = min(MINUTE_MS, formula(1e-9 if number < 0.5 else 1.0 - 1e-9))
    assert delays.next_ms() == pytest.approx(rarest, rel=1e-6)


N = 20_000
NORMAL_99 = 2.576  # [σ] half of the band that holds 99 % of a Gaussian
KOLMOGOROV_99 = 1.628  # [-] sup |F_n − F| √n stays below it in 99 % of samples


def test_delays_are_drawn_alike_from_everywhere_in_their_distribution() -> None:
    delays = Delays(Table((10.0, 30.0)), np.random.default_rng(11))
    ordered = sorted(delays.next_ms() for _ in range(N))
    assert ordered == pytest.approx(np.linspace(10.0, 30.0, N), abs=20.0 * KOLMOGOROV_99 / sqrt(N))


def losses(loss: Loss, seed: int = 5) -> list[Row | None]:
    decide = Losses(loss, Numbers(np.random.default_rng(seed)))
    return [decide.reason() for _ in range(N)]


@pytest.mark.parametrize("share", [0.001, 0.05, 0.5])
def test_independent_losses_have_their_share_and_no_memory(share: float) -> None:
    lost = np.array([reason is not None for reason in losses(Loss(loss_good=share))])
    assert abs(lost.mean() - share) < NORMAL_99 * sqrt(share * (1 - share) / N)
    pairs = (lost[1:] & lost[:-1]).mean()
    assert abs(pairs - share**2) < NORMAL_99 * sqrt(3.0 * share**2 / N)


def test_gilbert_elliott_begins_good_and_has_its_losses_and_its_length_of_bursts() -> None:
    model = Loss(to_bad=0.02, to_good=0.25, loss_good=0.01)
    reasons = losses(model)
    lost = np.array([reason is events.BURST for reason in reasons])
    checkpoint = 1.0 - model.to_bad - model.to_good
    share = model.to_bad / (model.to_good + model.to_bad)
    wide = (1.0 + checkpoint) / (1.0 - checkpoint)  # how much wider memory makes the band
    assert abs(lost.mean() - share) < NORMAL_99 * sqrt(share * (1 - share) / N * wide)
    bursts = int(np.sum(lost[1:] & ~lost[:-1])) + int(lost[0])
    length, spread = 1.0 / model.to_good, sqrt(1.0 - model.to_good) / model.to_good
    assert abs(lost.sum() / bursts - length) < NORMAL_99 * spread / sqrt(bursts)
    good = (1.0 - share) * model.loss_good
    assert abs(reasons.count(events.LOSS) / N - good) < NORMAL_99 * sqrt(good * (1 - good) / N)
    assert model.mean == pytest.approx(share + good)
    assert set(losses(Loss(to_bad=0.0, to_good=0.0))) == {None}


def passage(
    leg: DirectionProfile, step_ns: int = 10_000_000
) -> tuple[LinkDirection[int], list[tuple[int, bool]]]:
    line: LinkDirection[int] = LinkDirection(leg, np.random.default_rng(3))
    out: list[tuple[int, bool]] = []
    for k in range(N):
        line.enter(k, k * step_ns)
        while (arrival := line.leave(k * step_ns)) is not None:
            out.append((arrival.item, arrival.damaged))
    while (due := line.due()) is not None:
        arrival = line.leave(due)
        assert arrival is not None
        out.append((arrival.item, arrival.damaged))
    return line, out


def test_copies_damage_and_lateness_have_their_shares() -> None:
    share = 0.03
    leg = DirectionProfile(delay_ms=5.0, duplicate=share, corrupt=share, late=Late(share, 25.0))
    line, out = passage(leg)
    band = NORMAL_99 * sqrt(share * (1 - share) / N)
    assert abs(line.copied / N - share) < band
    damaged = len({item for item, is_damaged in out if is_damaged})
    assert abs(damaged / N - share) < band
    order = np.array(list(dict.fromkeys(item for item, _ in out)))
    overtaken = np.sum(order < np.maximum.accumulate(order))
    assert abs(overtaken / N - share) < band


def test_the_purposes_draw_from_streams_of_their_own() -> None:
    """Copies and delays do not change which messages are lost."""
    plain = DirectionProfile(loss=Loss(loss_good=0.1))
    busy = DirectionProfile(loss=Loss(loss_good=0.1), jitter_ms=8.0, duplicate=0.2, corrupt=0.2)
    lost = [[item for item, _ in passage(leg)[0].take_lost()] for leg in (plain, busy)]
    assert lost[0] == lost[1]
