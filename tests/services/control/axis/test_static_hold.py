"""Gains at rest and in motion."""

from math import exp, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.reference import Motion
from services.control.axis.axis import Axis, FeedbackGains, GainBlend, Gains, StaticGains
from services.control.axis.plant import ActuatorModel, Plant
from services.control.core import Settings
from services.runtime.config.stack import Stack

MOVING = FeedbackGains(50.0, 40.0, 0.0)
RESTING = StaticGains(kp=20.0, kd=90.0, zone=0.02, leave=0.1, blend=0.5)
AT_REST = FeedbackGains(RESTING.kp, RESTING.kd, RESTING.zone)
LAG, DT = 0.08, 0.01
error = st.floats(-0.3, 0.3)


def settled(blend: GainBlend, *, moves: bool, error: float) -> FeedbackGains:
    """The gains once the blend has had its time, and one step to show it."""
    for _ in range(round(RESTING.blend / DT) + 1):
        blend.step(moves, error, DT)
    return blend.step(moves, error, DT)


@given(error)
def test_it_begins_at_rest_and_motion_brings_the_moving_gains_in_the_time_of_the_blend(
    error: float,
) -> None:
    blend = GainBlend(MOVING, RESTING)
    assert blend.step(True, error, DT) == AT_REST
    last = round(RESTING.blend / DT)
    shares = [(blend.step(True, error, DT).kp - 20.0) / 30.0 for _ in range(last)]
    assert shares == sorted(shares)
    assert 0.45 < shares[last // 2 - 1] < 0.55
    assert shares[-2] < 1.0
    assert blend.step(True, error, DT) == MOVING


@given(error, error)
def test_a_large_error_calls_for_the_moving_gains_until_it_is_half_as_large(
    first: float, second: float
) -> None:
    blend = GainBlend(MOVING, RESTING)
    stirred = abs(first) > RESTING.leave
    assert settled(blend, moves=False, error=first) == (MOVING if stirred else AT_REST)
    stirred = abs(second) > RESTING.leave or (stirred and abs(second) > RESTING.leave / 2)
    assert settled(blend, moves=False, error=second) == (MOVING if stirred else AT_REST)


PLANT = Plant(0.375, 0.87, 1.53)  # the Pioneer's yaw
EDGE = 0.1376  # [N m] two thrusters at 0.8 N, 0.086 m off the middle
ON, OFF = 0.65, 0.35  # [-] of the edge: where a thruster is stepped over its dead-band, and back
HELD = Motion(0.0, 0.0, 0.0, 0.0)
PIONEER = Stack().section("control", Settings).heading
HUNTING = Gains(kp=8.0, kd=3.0, ki=1.0, max_error=0.6, max_integral=1.0)  # one set, an integral


class Yaw:
    """One axis with dead-band, lag and noise of the estimates, for a minute after settling."""

    def __init__(self, gains: Gains, disturbance: float, seed: int) -> None:
        rng = np.random.default_rng(seed)
        noise = (rng.normal(size=(12_000, 2)) * (3e-4, 1.2e-3)).tolist()  # [rad], [rad/s]
        law, produced = Axis(gains, PLANT, LAG, DT), ActuatorModel((LAG,) * 6)
        x, v, f = radians(1.0), 0.0, 0.0
        self._asked, self.angles, self.starts = 0.0, list[float](), 0
        for k, (off, off_rate) in enumerate(noise):
            if k:
                law.learn(v + off_rate, produced.mean(DT)[5], DT)
            command = self._driven(law.step(HELD, x + off, v + off_rate, DT), k > 6000)
            produced.settles_at = 0.0, 0.0, 0.0, 0.0, 0.0, command
            after = command + (f - command) * exp(-DT / LAG)
            v += ((f + after) / 2 + disturbance - PLANT.drag(v)) / PLANT.inertia * DT
            x, f = x + v * DT, after
            self.angles.append(x)
        self.angles = self.angles[6000:]

    def _driven(self, moment: float, counts: bool) -> float:
        before, needed = self._asked, EDGE * (OFF if self._asked else ON)
        size = 0.0 if abs(moment) < needed else max(EDGE, abs(moment))
        self._asked = size if moment > 0 else -size
        self.starts += counts and self._asked != 0.0 and before * self._asked <= 0.0
        return self._asked


@pytest.mark.parametrize("seed", range(2))
def test_undisturbed_the_thrusters_fall_silent_and_stay_so(seed: int) -> None:
    held, hunting = Yaw(PIONEER, 0.0, seed), Yaw(HUNTING, 0.0, seed)
    assert held.starts == 0
    assert np.ptp(held.angles) < 1e-4
    assert hunting.starts > 0  # an integral and a dead-band never come to rest
    assert np.ptp(hunting.angles) > radians(0.3)


@pytest.mark.parametrize("disturbance", [-0.1, 0.01, 0.3])
def test_a_disturbance_below_or_above_the_dead_band_moves_it_by_less_than_a_degree_and_a_half(
    disturbance: float,
) -> None:
    held = Yaw(PIONEER, disturbance, 1)
    early, late = np.split(np.array(held.angles), 2)
    assert max(map(abs, held.angles)) < radians(1.5)
    assert abs(early.mean() - late.mean()) < radians(0.1)  # no drift
    assert np.ptp(late) < radians(0.6)  # and no growing swing


# The two gain sets.

STATIC = StaticGains(kp=4.0, kd=2.0, zone=0.005, leave=0.15, blend=0.5)
rate = st.floats(-1.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(st.floats(-0.15, 0.15), rate, st.floats(0.01, 1.0), st.integers(1, 120), st.floats(0.0, 3.0))
def test_a_switch_of_gains_is_not_felt_at_the_switch(
    error: float, v: float, step: float, before: int, observer: float
) -> None:
    """Twins that differ only in that one is asked to move: at that step their efforts differ by
    the feed-forward and by the damping of the new velocity alone."""
    gains = Gains(
        kp=8.0, kd=3.0, ki=1.0, max_error=0.6, max_integral=1.0, static=STATIC, observer=observer
    )
    still, moving = Axis(gains, PLANT), Axis(gains, PLANT)
    for law in (still, moving):
        for _ in range(before):
            law.learn(v, 0.1, DT)
            law.step(HELD, error, v, DT)
    asked = Motion(0.0, step, 0.0, 0.0)
    calm = still.step(HELD, error, v, 0.0)
    first = moving.step(asked, error, v, 0.0) - moving.feed_forward(asked)
    assert first - calm == pytest.approx(STATIC.kd * step, abs=1e-9)


def test_the_integral_takes_over_what_the_gains_give_up() -> None:
    """Coming to rest against a steady push, the effort stays as it was."""
    gains = Gains(kp=8.0, kd=3.0, ki=0.0, max_error=0.6, max_integral=1.0, static=STATIC)
    law = Axis(gains, PLANT)
    for _ in range(100):
        law.step(Motion(0.0, 1e-3, 0.0, 0.0), -0.05, 0.0, DT)
    before = law.step(HELD, -0.05, 0.0, DT)
    after = [law.step(HELD, -0.05, 0.0, DT) for _ in range(100)][-1]
    assert after == pytest.approx(before, abs=1e-9)
    assert law.standing == pytest.approx(8.0 * 0.05 - 4.0 * 0.045)


def test_a_zone_wider_than_its_limit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"zone is 0.2, it must be smaller than leave 0.1"):
        StaticGains(kp=1.0, kd=1.0, zone=0.2)
