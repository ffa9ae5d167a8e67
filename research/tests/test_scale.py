"""The model of a large fleet: it finds what was planted, also where it was not fitted."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lindy_research.scale.__main__ import PAGE
from lindy_research.scale.model import (
    FleetPlan,
    ScaleModel,
    ScalePoint,
    check,
    core_routers,
    fit,
    halves,
    load,
)
from lindy_research.scale.page import measured, page
from lindy_research.scale.traffic import FleetTraffic, flown, watched

POSITIVE = st.floats(1e-4, 1e2)
LOADS = st.lists(st.floats(100.0, 1e5), min_size=4, max_size=12, unique=True)


def point(hz: float, model: ScaleModel, payload: float = 300.0) -> ScalePoint:
    passing = FleetTraffic(hz, hz * payload)
    wire = model.bits_hz(passing) / 8.0
    return ScalePoint(1, 1.0, hz, passing.payload_hz, wire, model.cores(passing), 1.0, 2.0)


@given(st.floats(1e-3, 0.1), st.floats(1e-6, 1e-4), st.floats(5.0, 100.0), LOADS)
def test_a_straight_line_is_found_and_checks(
    idle: float, per_message: float, overhead: float, loads: list[float]
) -> None:
    loads = [1_000.0 * n + hz for n, hz in enumerate(sorted(loads))]  # well apart
    planted = ScaleModel(idle, per_message, overhead)
    to_fit, to_check = halves([point(hz, planted) for hz in loads])
    assert len(to_fit) + len(to_check) == len(loads)
    assert not {p.messages_hz for p in to_fit} & {p.messages_hz for p in to_check}
    for miss in check(fit(to_fit), to_check):
        assert abs(miss.cores_off) < 1e-3
        assert miss.wire_off is not None
        assert abs(miss.wire_off) < 1e-6


def test_a_model_that_does_not_hold_is_seen_to_be_wrong() -> None:
    points = [point(hz, ScaleModel(0.0, 1e-5, 20.0)) for hz in (1e3, 2e3, 3e3, 1e4)]
    points[-1] = point(1e4, ScaleModel(0.0, 3e-5, 20.0))  # three times as dear where it is busy
    (_, last) = check(fit(points[:3]), points[2:])
    assert last.cores_off == pytest.approx(-2 / 3, abs=0.01)


@given(st.integers(1, 2_000), POSITIVE, POSITIVE)
def test_twice_the_drones_are_twice_the_load_and_a_site_keeps_its_own(
    drones: int, hz: float, size: float
) -> None:
    up, down, looked = (
        FleetTraffic(hz, size),
        FleetTraffic(hz / 8, size / 8),
        FleetTraffic(hz / 50, size / 50),
    )
    one = load(FleetPlan(drones), up, down, looked)
    two = load(FleetPlan(2 * drones), up, down, looked)
    assert np.allclose(two.core, np.multiply(2.0, one.core))
    assert np.allclose(two.watcher, np.multiply(2.0, one.watcher))
    assert two.site == one.site


@given(st.integers(1, 5_000), st.floats(1e-6, 1e-4))
def test_no_core_router_needs_more_than_the_plan_allows(drones: int, per_message: float) -> None:
    model, plan = ScaleModel(0.01, per_message, 20.0), FleetPlan(drones)
    passing = load(plan, flown("drone"), flown("topside"), watched()).core
    count = core_routers(plan, model, passing)
    each = FleetTraffic(passing.messages_hz / count, 0.0)
    assert model.cores(each) <= plan.most_cores + 1e-9
    if count > 1:
        assert model.cores(FleetTraffic(passing.messages_hz / (count - 1), 0.0)) > plan.most_cores


def test_a_thinned_link_carries_less_up_and_who_watches_hears_little() -> None:
    up, thin = flown("drone"), flown("drone", thinned=True)
    assert thin.messages_hz < up.messages_hz / 3
    assert watched().messages_hz < up.messages_hz / 50


def test_the_page_is_written_from_the_points() -> None:
    """`make docs` writes it."""
    assert PAGE.read_text(encoding="utf-8") == page()
    assert {p.drones for p in measured().points} >= {1, 2, 4, 8}
