"""Delay distributions by themselves: what each refuses, and its quantiles by formula."""

from collections.abc import Callable
from itertools import pairwise
from math import log
from typing import cast

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from services.tether.delay import Delays, Drawn, Exponential, Floats, Pareto, Table, Trace

ms = st.floats(0.0, 300.0) | st.floats(0.0, 2.0) | st.just(0.0)
share = st.floats(1e-9, 1.0 - 1e-9)
MINUTE_MS = 60_000.0  # longer than this no message takes

late = st.floats(-0.5, 1.5) | st.floats(59.9, 60.1) | st.floats(-80.0, 80.0)  # [s]
row = st.tuples(st.floats(-0.1, 1.0) | st.just(0.0), st.none() | late)


@given(st.lists(row, max_size=6), st.integers(-1, 1), st.sampled_from(["", "rows.csv"]))
@example([(0.5, 0.0), (0.5, 60.0), (0.5, None)], 0, "")
@example([(0.5, 0.0), (0.5, 60.1)], 0, "")
@example([(0.5, 0.0), (0.5, -0.1)], 0, "")
@example([(0.5, 0.0), (0.0, 0.1)], 0, "")
@example([(0.5, 0.0), (0.5, 0.1)], 1, "")
def test_a_trace_is_rows_in_order_each_lost_or_arrived_within_a_minute(
    rows: list[tuple[float, float | None]], more: int, file: str
) -> None:
    sent = tuple(np.cumsum([step for step, _ in rows]).tolist())
    arrived = tuple(
        None if later is None else at + later for at, (_, later) in zip(sent, rows, strict=True)
    )
    if more > 0:
        arrived += (None,)
    elif more < 0:
        arrived = arrived[:-1]
    as_long = len(sent) == len(arrived)
    ascending = all(before < after for before, after in pairwise(sent))
    in_time = all(b is None or 0.0 <= b - a <= 60.0 for a, b in zip(sent, arrived, strict=False))
    if as_long and (sent or file) and ascending and in_time:
        assert Trace(file, sent, arrived).arrived_s == arrived
        return
    said = "60 s" if not in_time else "ascending"
    said = "ascending" if not ascending else said
    said = "needs a file" if not sent and not file else said
    said = "same length" if not as_long else said
    with pytest.raises(ValueError, match=said):
        Trace(file, sent, arrived)


@given(st.floats(0.0, 100.0), st.none() | st.floats(0.0, 60.0), st.floats(0.0, 1e4))
def test_a_trace_of_one_row_is_that_delay_or_loss_for_ever(
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


@given(st.floats(1e4, MINUTE_MS))
def test_no_message_takes_longer_than_a_minute(mean_ms: float) -> None:
    for spread in (Exponential(mean_ms), Pareto(mean_ms, 1.5)):
        delays = Delays(spread, np.random.default_rng(1))
        longest = max(delays.next_ms() for _ in range(2000))
        assert 0.5 * MINUTE_MS < longest <= MINUTE_MS
        if mean_ms > 0.5 * MINUTE_MS:
            assert longest == MINUTE_MS


@pytest.mark.parametrize(
    ("spread", "mean"),
    [
        (Table((2.0, 8.0)), 5.0),
        (Exponential(15.0), 15.0),
        (Pareto(40.0, 2.5), 40.0),
        (Table((1.0, 3.0, 2.0)), 2.0),
        (Exponential(1e6), 60_000.0),  # nearly all of it is cut off at a minute
    ],
)
def test_the_declared_mean_is_that_of_the_distribution(spread: Drawn, mean: float) -> None:
    assert spread.expected == pytest.approx(mean, rel=0.05 if mean == MINUTE_MS else 0.005)
