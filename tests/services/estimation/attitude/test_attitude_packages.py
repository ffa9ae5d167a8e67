"""The attitude beside that of two published packages, where they are installed."""

from importlib import import_module
from math import degrees
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_filter import AttitudeFilter, AttitudeSettings, unit
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.attitude.heading import wrapped
from services.marine.attitude import (
    LEVEL,
    attitude_rate,
    down_in_body,
    from_euler,
    to_body,
    to_euler,
    to_world,
)
from tests.support import heading_runs as runs
from tests.support import marg

BETA = 0.033  # [rad/s]


@pytest.fixture(scope="module")
def dive() -> runs.HeadingSamples:
    """Half a minute of pitching and turning, after rest level and north, with noise and bias."""
    return runs.measured(runs.dive(30.0), 3, runs.TYPICAL)


def package(name: str) -> Any:
    pytest.importorskip(name, reason=f"{name} is a development dependency and not installed")
    return import_module(name)


@pytest.mark.slow
def test_with_magnetometer_every_step_equals_that_of_ahrs(dive: runs.HeadingSamples) -> None:
    theirs = package("ahrs").filters.Madgwick(gain=BETA, Dt=runs.DT)
    ours: Quaternion = from_euler(0.02, -0.01, 0.1)
    other = np.array(ours)
    for rate, force, field in list(zip(dive.rate, dive.force, dive.field, strict=True))[:1500]:
        ours = marg.step(ours, rate, force, field, BETA, runs.DT)
        up = -np.array(force)
        other = theirs.updateMARG(other, np.array(rate), up, 1e6 * np.array(field))
        assert ours == pytest.approx(other.tolist(), abs=1e-11)


@pytest.mark.slow
def test_in_a_dive_roll_and_pitch_are_nearer_to_the_truth_than_those_of_ahrs() -> None:
    flight = runs.dive(30.0)
    samples = runs.measured(flight, 3, runs.TYPICAL)
    theirs = package("ahrs").filters.Madgwick(gain=BETA, Dt=runs.DT)
    p, q, r = np.mean(samples.rate[: flight.calibrated], axis=0).tolist()
    ours = AttitudeObserver(AttitudeSettings(), (p, q, r), 0.0, 0.0)
    other, sums = np.array([1.0, 0.0, 0.0, 0.0]), [0.0, 0.0]
    for k, (rate, force) in enumerate(zip(samples.rate, samples.force, strict=True)):
        ours.step(rate, force, runs.DT)
        other = theirs.updateIMU(other, np.array(rate), -np.array(force))
        w, x, y, z = flight.attitude[k].tolist()
        down = np.array(down_in_body((w, x, y, z)))
        a, b, c, d = (float(each) for each in other)
        for n, q in enumerate((ours.filter.q, (a, b, c, d))):
            sums[n] += float(np.sum((np.array(down_in_body(q)) - down) ** 2))
    assert sums[0] < sums[1]


@pytest.mark.slow
def test_the_heading_drifts_as_that_of_imufusion(dive: runs.HeadingSamples) -> None:
    imufusion = package("imufusion")
    theirs = imufusion.Ahrs()
    settings = imufusion.AhrsSettings()
    for name, value in (("gain", 0.05), ("convention", imufusion.CONVENTION_NED)):
        setattr(settings, name, value)
    theirs.set_settings(settings)
    theirs.set_sample_period(runs.DT)
    ours = AttitudeFilter()
    turned_ours, turned_theirs, before, before_theirs = 0.0, 0.0, 0.0, None
    for k, (rate, force) in enumerate(zip(dive.rate, dive.force, strict=True)):
        ours.step(rate, force, runs.DT, 0.01 * runs.DT, 0.1)
        # In its NED, as here, a level sensor at rest measures gravity upwards: (0, 0, -1).
        theirs.update_no_magnetometer(np.degrees(rate), np.array(force) / 9.81)
        if k < 500:
            before = to_euler(ours.q)[2]
            continue
        w, x, y, z = (float(c) for c in theirs.get_quaternion())
        heading = to_euler((w, x, y, z))[2]
        if before_theirs is not None:
            turned_theirs += wrapped(heading - before_theirs)
            turned_ours += wrapped(to_euler(ours.q)[2] - before)
        before_theirs, before = heading, to_euler(ours.q)[2]
    assert degrees(abs(turned_ours - turned_theirs)) < 0.3


# The product that the equations of motion use, and the laws of its group.

component = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(component, component, component, component)
    .filter(lambda q: sum(c * c for c in q) > 0.01)
    .map(lambda q: unit(*q))
)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
law = settings(max_examples=100, deadline=None)


def product(q: Quaternion, p: Quaternion) -> Quaternion:
    """q ⊗ p from dq/dt = ½ q ⊗ ω."""
    w, x, y, z = p
    a, b, c, d = attitude_rate(q, (2 * x, 2 * y, 2 * z))
    return a + w * q[0], b + w * q[1], c + w * q[2], d + w * q[3]


@law
@given(quaternions, quaternions, quaternions)
def test_turns_compose_associatively_and_stay_turns(
    a: Quaternion, b: Quaternion, c: Quaternion
) -> None:
    left, right = product(product(a, b), c), product(a, product(b, c))
    assert left == pytest.approx(right, abs=1e-12)
    assert sum(x * x for x in left) == pytest.approx(1.0, abs=1e-12)


@law
@given(quaternions)
def test_level_is_neutral_and_every_turn_can_be_undone(q: Quaternion) -> None:
    w, x, y, z = q
    assert product(q, LEVEL) == product(LEVEL, q) == pytest.approx(q)
    assert product(q, (w, -x, -y, -z)) == pytest.approx(LEVEL, abs=1e-12)
    assert product((w, -x, -y, -z), q) == pytest.approx(LEVEL, abs=1e-12)


@law
@given(quaternions, quaternions, vectors)
def test_the_product_turns_a_vector_as_one_after_the_other_does(
    a: Quaternion, b: Quaternion, v: Vec3
) -> None:
    assert to_world(product(a, b), v) == pytest.approx(to_world(a, to_world(b, v)), abs=1e-9)
    assert to_body(product(a, b), v) == pytest.approx(to_body(b, to_body(a, v)), abs=1e-9)


@law
@given(quaternions, vectors)
def test_a_quaternion_and_its_negative_are_one_turn(q: Quaternion, v: Vec3) -> None:
    w, x, y, z = q
    assert to_world((-w, -x, -y, -z), v) == pytest.approx(to_world(q, v), abs=1e-12)
