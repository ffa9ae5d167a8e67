"""Inertia and Coriolis forces keep the laws of mechanics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec6
from services.marine.hydrodynamics import coriolis, system_inertia
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from tests.support.textbook_vessel import kinetic_energy

PIONEER = Stack().section("vehicle", Vehicle)
motion = st.tuples(*[st.floats(-3, 3)] * 6)
inertia = st.tuples(*[st.floats(0.1, 500)] * 6)
law = settings(max_examples=100, deadline=None)


def cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@law
@given(inertia, motion)
def test_coriolis_does_no_work(M: Vec6, nu: Vec6) -> None:
    work = sum(c * n for c, n in zip(coriolis(M, nu), nu, strict=True))
    assert work == pytest.approx(0.0, abs=1e-9 * (1 + kinetic_energy(M, nu)) * 10)


@law
@given(inertia, motion)
def test_coriolis_is_fossens_matrix(M: Vec6, nu: Vec6) -> None:
    linear, angular = cross_matrix(np.multiply(M[:3], nu[:3])), np.multiply(M[3:], nu[3:])
    C = np.block([[np.zeros((3, 3)), -linear], [-linear, -cross_matrix(angular)]])
    assert coriolis(M, nu) == pytest.approx(C @ nu, abs=1e-6)


def test_a_rigid_body_alone_feels_the_centripetal_force() -> None:
    mass = 2.0
    M = (mass, mass, mass, 1.0, 1.0, 1.0)
    assert coriolis(M, (3.0, 0, 0, 0, 0, 0.5)) == pytest.approx((0, mass * 3.0 * 0.5, 0, 0, 0, 0))


def test_inertia_is_the_body_and_the_water_it_moves() -> None:
    M = system_inertia(PIONEER)
    assert M[0] == pytest.approx(8.6 + 5.22)
    assert M[5] == pytest.approx(0.216 + 0.159)
    assert kinetic_energy(M, (2.0, 0, 0, 0, 0, 0)) == pytest.approx(2 * M[0])
