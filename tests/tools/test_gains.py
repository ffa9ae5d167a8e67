"""`lindy gains`: the optimum is one, and what is printed goes into a vehicle file."""

import tomllib
from math import exp

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from services.control.axis.axis import Gains
from services.control.axis.plant import Plant
from services.runtime.config.errors import LindyError
from tools.gains import Worth, feedback, gains, regulator, sampled

IDENTIFIED = Plant(13.3, 6.5)  # Andrén 2023, Table 6.1, as identified


@given(st.floats(0.1, 100.0), st.floats(0.0, 100.0), st.floats(0.001, 0.1))
def test_two_half_steps_are_a_whole_one(inertia: float, damping: float, dt: float) -> None:
    plant = Plant(inertia, damping)
    (A, B), (half, push) = sampled(plant, dt), sampled(plant, dt / 2)
    assert half @ half == pytest.approx(A, rel=1e-9)
    assert half @ push + push == pytest.approx(B, rel=1e-6)
    assert A[1, 1] == pytest.approx(exp(-damping * dt / inertia), abs=1e-12)
    assert damping * B[1, 0] == pytest.approx(1 - A[1, 1], abs=1e-12)  # settles at u / d


@settings(max_examples=30, deadline=None)
@given(st.floats(0.2, 100.0), st.floats(0.0, 50.0), st.floats(0.01, 1.0), st.floats(0.1, 50.0))
def test_no_other_gain_costs_less(
    inertia: float, damping: float, error: float, force: float
) -> None:
    """The sum of costs from any start grows when any gain moves away from the optimum."""
    A, B = sampled(Plant(inertia, damping), 0.01)
    Q, rho = np.diag([1 / error**2, 1.0]), 1 / force**2
    best = regulator(A, B, Q, rho)

    def cost(K: NDArray[np.float64]) -> float:
        """Trace of the solution of P = Q + ρ KᵀK + (A - BK)ᵀ P (A - BK)."""
        closed = A - B @ K[None, :]
        total, term = Q + rho * np.outer(K, K), closed
        for _ in range(40):
            total, term = total + term.T @ total @ term, term @ term
        return float(np.trace(total))

    least = cost(best)
    for other in (best * 1.1, best * 0.9, best * (1.1, 0.95), best * (0.95, 1.1)):
        assert cost(other) >= least * (1 - 1e-9)


def test_more_force_for_the_same_error_is_a_stiffer_loop() -> None:
    stiffness = [feedback(IDENTIFIED, Worth(0.05, 0.1, f, 5.0), 0.01).kp for f in (1.0, 5.0, 25.0)]
    assert stiffness == sorted(stiffness)
    assert stiffness[0] > 0


@pytest.mark.parametrize("axis", ["depth", "heading", "surge", "sway"])
def test_what_is_printed_goes_into_a_vehicle_file(
    axis: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert gains(axis, observer=1.0) == 0  # type: ignore[arg-type]
    table = tomllib.loads(capsys.readouterr().out)["control"][axis]
    assert Gains(**table).observer == 1.0


def test_a_wish_that_no_thruster_can_fulfil_is_refused() -> None:
    with pytest.raises(LindyError, match=r"not stable behind thrusters with a lag of 0.08 s"):
        gains("depth", error=1e-4, effort=1e3)
    with pytest.raises(LindyError, match=r"--error is -1, expected more than 0"):
        gains("depth", error=-1.0)


def test_weights_that_nothing_satisfies_are_one_sentence() -> None:
    with pytest.raises(LindyError, match="these weights have no settled solution; choose nearer"):
        gains("depth", error_rate=1e-300)
