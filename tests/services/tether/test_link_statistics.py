"""Every distribution and loss model against its formula, over 100,000 messages.

Bands hold with 99 % confidence for an honest model; the seeds are fixed, so a test either always
passes or never.
"""

from collections.abc import Callable
from math import exp, sqrt
from typing import Any

import numpy as np
import pytest

from messages import events
from messages.events import Row
from services.tether.delay import Delays, Drawn, Exponential, Pareto, Table
from services.tether.link_model import LinkDirection
from services.tether.loss import Loss, Losses
from services.tether.profile import DirectionProfile, Late
from services.tether.random_streams import UniformStream as Numbers

N = 100_000
NORMAL_99 = 2.576  # [σ] half of the band that holds 99 % of a Gaussian
KOLMOGOROV_99 = 1.628  # [-] sup |F_n − F| √n stays below it in 99 % of samples
S = 1_000_000_000  # [ns]
CDF = Callable[[float], float]

SHAPES: list[tuple[Drawn, CDF]] = [
    (Table((10.0, 30.0)), lambda x: (x - 10.0) / 20.0),
    (Exponential(12.0), lambda x: 1.0 - exp(-x / 12.0)),
    (Pareto(10.0, 3.0), lambda x: 1.0 - (1.0 + x / 20.0) ** -3.0),
    (Table((1.0, 2.0, 6.0)), lambda x: (x - 1.0) / 2.0 if x < 2.0 else 0.5 + (x - 2.0) / 8.0),
]


def drawn(spread: Drawn, count: int, seed: int = 11) -> np.ndarray[Any, np.dtype[np.float64]]:
    delays = Delays(spread, np.random.default_rng(seed))
    return np.array([delays.next_ms() for _ in range(count)])


def furthest(values: np.ndarray[Any, np.dtype[np.float64]], cdf: CDF) -> float:
    """Kolmogorov's distance between a sample and a distribution."""
    ordered = np.sort(values)
    expected = np.array([cdf(x) for x in ordered.tolist()])
    steps = np.arange(len(ordered) + 1) / len(ordered)
    return float(max(np.max(steps[1:] - expected), np.max(expected - steps[:-1])))


@pytest.mark.parametrize(("spread", "cdf"), SHAPES, ids=lambda p: type(p).__name__)
def test_delays_have_the_distribution_of_their_name(spread: Drawn, cdf: CDF) -> None:
    assert furthest(drawn(spread, N), cdf) < KOLMOGOROV_99 / sqrt(N)


def losses(loss: Loss, seed: int = 5) -> list[Row | None]:
    decide = Losses(loss, Numbers(np.random.default_rng(seed)))
    return [decide.reason() for _ in range(N)]


@pytest.mark.parametrize("share", [0.001, 0.05, 0.5])
def test_independent_losses_have_their_share_and_no_memory(share: float) -> None:
    lost = np.array([reason is not None for reason in losses(Loss(loss_good=share))])
    assert abs(lost.mean() - share) < NORMAL_99 * sqrt(share * (1 - share) / N)
    pairs = (lost[1:] & lost[:-1]).mean()
    assert abs(pairs - share**2) < NORMAL_99 * sqrt(3.0 * share**2 / N)


def test_gilbert_elliott_has_its_mean_loss_and_its_length_of_bursts() -> None:
    model = Loss(to_bad=0.02, to_good=0.25)
    lost = np.array([reason is events.BURST for reason in losses(model)])
    checkpoint = 1.0 - model.to_bad - model.to_good
    share = model.mean
    wide = (1.0 + checkpoint) / (1.0 - checkpoint)  # how much wider memory makes the band
    assert abs(lost.mean() - share) < NORMAL_99 * sqrt(share * (1 - share) / N * wide)
    bursts = int(np.sum(lost[1:] & ~lost[:-1])) + int(lost[0])
    length, spread = 1.0 / model.to_good, sqrt(1.0 - model.to_good) / model.to_good
    assert abs(lost.sum() / bursts - length) < NORMAL_99 * spread / sqrt(bursts)


def test_a_gilbert_elliott_link_begins_good() -> None:
    assert set(losses(Loss(to_bad=0.0, to_good=0.0))) == {None}


def test_gilbert_elliott_loses_in_the_good_state_too_when_told_to() -> None:
    model = Loss(to_bad=0.02, to_good=0.25, loss_bad=0.6, loss_good=0.01)
    reasons = losses(model)
    share = model.to_good * model.loss_good / (model.to_good + model.to_bad)
    found = reasons.count(events.LOSS) / N
    assert abs(found - share) < NORMAL_99 * sqrt(share * (1 - share) / N)
    assert reasons.count(events.BURST) > 0


@pytest.mark.parametrize("to_bad", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("to_good", [0.0, 0.3, 1.0])
def test_only_a_link_that_would_stay_bad_for_ever_is_refused(to_bad: float, to_good: float) -> None:
    if to_bad > 0.0 and to_good == 0.0:
        with pytest.raises(ValueError, match="bad for ever"):
            Loss(to_bad, to_good)
    else:
        assert 0.0 <= Loss(to_bad, to_good).mean < 1.0


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
    order = list(dict.fromkeys(item for item, _ in out))
    overtaken = sum(here < max_before for here, max_before in _with_maximum(order))
    assert abs(overtaken / N - share) < band


def _with_maximum(order: list[int]) -> list[tuple[int, int]]:
    highest, pairs = -1, list[tuple[int, int]]()
    for here in order:
        pairs.append((here, highest))
        highest = max(highest, here)
    return pairs


@pytest.mark.slow
def test_the_purposes_draw_from_streams_of_their_own() -> None:
    """Copies and delays do not change which messages are lost."""
    plain = DirectionProfile(loss=Loss(loss_good=0.1))
    busy = DirectionProfile(loss=Loss(loss_good=0.1), jitter_ms=8.0, duplicate=0.2, corrupt=0.2)
    lost = [[item for item, _ in passage(leg)[0].take_lost()] for leg in (plain, busy)]
    assert lost[0] == lost[1]
