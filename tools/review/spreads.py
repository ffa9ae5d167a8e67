"""Sensor spreads for the vehicle file, from a dive under way, and tried on that dive.

Noise at rest is not what a filter has to expect: under way the accelerometer feels thrusters and
every error of tilt, which the pressure does not. A spread of the pressure that is true at rest, put
beside a spread of the accelerometer that is not true under way, makes the filter follow the wrong
one. So both are taken under way, and judged by what they are for: the innovations of the pressure
are white where all spreads are right (Mehra 1970, *On the identification of variances and adaptive
Kalman filtering*). What does not make them whiter is not proposed.
"""

from collections.abc import Callable, Sequence
from math import radians, sqrt

import msgspec
import numpy as np

from services.estimation.settings import DepthSettings
from tools.report.columns import Array
from tools.review.estimated import Estimated

# [-] times the vibration along gravity: tilt adds to it. What needs more is no noise of the
# accelerometer but another error of this dive, which the next dive may not have.
STEPS = (1.0, 2.0, 3.0, 5.0)
MOST_TILT = radians(40.0)  # [rad] from level: beyond, gravity's share of the error is not noise
MOST_NOISE = 1.0  # [m/s²/√Hz] more is no accelerometer any more
WHITE = 0.2  # [-] a smaller correlation of an innovation with the next is none
AS_STATED = 2.0  # [-] innovations within this of what was expected of them
MOST_LEFT = 0.5  # [-] of the correlation before: a proposal must leave less
MORE_REJECTED = 0.005  # [-] of the samples: a proposal that rejects more is none
LESS_KNOWN = 0.99  # [-] of the time in which the state is known: less is worse
TRIAL_S = 300.0  # [s] of the dive on which proposals are tried
FEWEST = 50  # pressure samples
THIRD = sqrt(20.0)  # spread of third differences of white noise of 1


class Trial(msgspec.Struct, kw_only=True, frozen=True):
    """What the estimator makes of the dive with these spreads."""

    pressure_std: float  # [Pa]
    acceleration_noise: float  # [m/s²/√Hz]
    lag_one: float | None  # [-] correlation of each innovation of the pressure with the next
    spread_ratio: float | None  # [-] innovations over what was expected of them
    rejected: float  # [-] share of the pressure samples
    known_s: float  # [s] in which roll, pitch and depth were known


class SpreadProposal(msgspec.Struct, kw_only=True, frozen=True):
    """What to put into the vehicle file."""

    measured_pressure_std: float  # [Pa] of one sample under way
    tried_s: float  # [s] of the dive
    before: Trial
    trials: list[Trial]
    chosen: int | None  # which of the trials is proposed; None: none is better
    toml: str  # to copy; empty: nothing is proposed
    words: str  # what was found, and why


def pressure_noise(pressure: Array) -> float | None:
    """[Pa] 1σ of one sample of a moving vehicle, by third differences: its motion, smooth from
    sample to sample, has nearly none. None: too few."""
    if len(pressure) < FEWEST:
        return None
    rough = 1.4826 * float(np.median(np.abs(np.diff(pressure, 3)))) / THIRD
    different = np.diff(np.unique(pressure))
    step = float(different.min()) if len(different) else 0.0
    return max(rough, step / sqrt(12.0)) or None  # noise below a step cannot be seen


def proposal(
    now: DepthSettings,
    vibration: float,
    pressure_std: float,
    seconds: float,
    estimate: Callable[[Sequence[str]], Estimated],
) -> SpreadProposal:
    """
    Args:
        now: what the vehicle file says.
        vibration: [m/s²/√Hz] along gravity, under way.
        pressure_std: [Pa] likewise.
        seconds: [s] of the dive that `estimate` runs over.
        estimate: the estimator over the dive, with key.path=value into the vehicle file.
    """

    def tried(pascal: float, noise: float, overrides: Sequence[str]) -> Trial:
        return _trial(estimate(overrides), pascal, noise)

    before = tried(now.pressure_std, now.acceleration_noise, ())
    trials: list[Trial] = []
    if before.lag_one is not None and abs(before.lag_one) >= WHITE:
        pascal = _digits(pressure_std)
        for step in STEPS:
            noise = _digits(step * vibration)
            if noise > MOST_NOISE:
                break
            trials.append(tried(pascal, noise, _overrides(pascal, noise)))
            if abs(trials[-1].lag_one or 1.0) < WHITE and _best(before, trials) == len(trials) - 1:
                break  # the smallest that is white
    chosen = _best(before, trials)
    return SpreadProposal(
        measured_pressure_std=_digits(pressure_std),
        tried_s=round(seconds, 1),
        before=before,
        trials=trials,
        chosen=chosen,
        toml="" if chosen is None else _toml(trials[chosen]),
        words=_words(before, trials, chosen),
    )


def _trial(found: Estimated, pascal: float, noise: float) -> Trial:
    pressure = found.innovations.get("pressure")
    known = 0.0 if found.track is None else found.track.seconds_known
    lag_one = spread = None
    rejected = 0.0
    if pressure is not None:
        lag_one, spread = pressure.lag_one, pressure.spread_ratio
        rejected = pressure.share_rejected
    return Trial(
        pressure_std=pascal,
        acceleration_noise=noise,
        lag_one=None if lag_one is None else round(lag_one, 3),
        spread_ratio=None if spread is None else _digits(spread),
        rejected=round(rejected, 4),
        known_s=round(known, 1),
    )


def _is_sound(trial: Trial, before: Trial) -> bool:
    """Does it use and know at least as much as before?"""
    return (
        trial.rejected <= before.rejected + MORE_REJECTED
        and trial.known_s >= LESS_KNOWN * before.known_s
    )


def _best(before: Trial, trials: list[Trial]) -> int | None:
    if before.lag_one is None:
        return None
    whiter = [
        (abs(trial.lag_one), n)
        for n, trial in enumerate(trials)
        if trial.lag_one is not None
        and abs(trial.lag_one) <= MOST_LEFT * abs(before.lag_one)
        and _is_sound(trial, before)
    ]
    return min(whiter)[1] if whiter else None


def _words(before: Trial, trials: list[Trial], chosen: int | None) -> str:
    if before.lag_one is None:
        return (
            "Lindy's estimation compared too few pressure samples with its own motion, so spreads "
            "cannot be tried on this dive and none are proposed."
        )
    said = f"one pressure sample after the other errs alike (correlation {before.lag_one:.2f})"
    if not trials:
        size = before.spread_ratio or 1.0
        if not 1.0 / AS_STATED <= size <= AS_STATED:
            return (
                f"The pressure errs at random (correlation {before.lag_one:.2f}), but {size:.2g} "
                f"times as much as the vehicle file says; with nothing else wrong, nothing is "
                f"proposed."
            )
        return (
            f"The spreads of the vehicle file fit this dive (correlation {before.lag_one:.2f}); "
            f"nothing to change."
        )
    if chosen is None:
        return (
            f"With the spreads of the vehicle file {said}, but none of {len(trials)} other pairs "
            f"with up to {STEPS[-1]:g} times the vibration measured halved that without rejecting "
            f"more or knowing less, so none is proposed."
        )
    return (
        f"With the spreads of the vehicle file {said}; with those proposed here it does not "
        f"({trials[chosen].lag_one:.2f})."
        if abs(trials[chosen].lag_one or 0.0) < WHITE
        else f"With the spreads of the vehicle file {said}; with those proposed here less "
        f"({trials[chosen].lag_one:.2f})."
    )


def _overrides(pascal: float, noise: float) -> tuple[str, ...]:
    section = "estimation.depth"
    return f"{section}.pressure_std={pascal!r}", f"{section}.acceleration_noise={noise!r}"


def _toml(trial: Trial) -> str:
    return (
        f"[estimation.depth]\n"
        f"pressure_std = {trial.pressure_std!r}  # [Pa] under way\n"
        f"acceleration_noise = {trial.acceleration_noise!r}  # [m/s²/√Hz] under way, with tilt\n"
    )


def _digits(value: float) -> float:
    return float(f"{value:.3g}")
