"""Topside, the predicted now is far nearer to the truth than the picture that arrives late."""

from math import pi
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.reference import Motion
from services.predictor.core import (
    Change,
    Predictor,
    coasting,
    joined,
    reference_ahead,
)
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Limits, Ramp
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import Skew
from tests.support import said
from tests.support.dive import CHAIN as FLOWN
from tests.support.dive import Dive

SECOND = 1_000_000_000
LIMITS = Limits(1.5, 0.5)
CHAIN = (*FLOWN, "link_monitor", "predictor")
STICKS = """0,0,0,0,0
1,0,0,1,0
4,0,0,0,0
6,0.5,0,-0.5,0.6
9,0,0,0,0
10,0,0,0.7,-1
12,0.3,0,0.7,0.2
14,0,0,0,0
18,0,0,0,0
"""
targets = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.floats(-0.5, 0.5)), min_size=1, max_size=6
).map(lambda pairs: sorted(pairs))


@given(changes=targets, seen=st.floats(0.0, 1.0), until=st.floats(0.0, 3.0))
@settings(max_examples=200, deadline=None)
def test_the_reference_run_ahead_is_the_drones_own(
    changes: list[tuple[float, float]], seen: float, until: float
) -> None:
    """Whoever sees the motion of an instant and all that follows knows the rest of it."""
    until += seen
    drone = Ramp(LIMITS)
    for at, target in [c for c in changes if c[0] <= seen]:
        drone.aim(target, at)
    motion = Motion(*drone.at(seen))
    known = [Change(0.0, drone.target)]
    known += [Change(at, target) for at, target in changes if at > seen]
    for change in known[1:]:
        if change.at < until:
            drone.aim(change.target, change.at)
    ahead = reference_ahead(motion, seen, known, LIMITS, until)
    assert ahead.position == pytest.approx(drone.at(until).position, abs=1e-6)
    assert ahead.velocity == pytest.approx(drone.at(until).velocity, abs=1e-6)


@given(seconds=st.floats(0.0, 2.0), off=st.floats(-1.0, 1.0), faster=st.floats(-1.0, 1.0))
def test_a_vehicle_on_its_reference_is_predicted_on_it_and_one_beside_stays_beside(
    seconds: float, off: float, faster: float
) -> None:
    motion = Motion(1.0, 0.3, 0.1, 0.0)
    ahead = coasting(motion, seconds)
    assert joined(ahead, motion, 1.0, 0.3, seconds) == pytest.approx(ahead[:2])
    position, rate = joined(ahead, motion, 1.0 + off, 0.3 + faster, seconds)
    assert abs(position - ahead.position - off) <= abs(faster) * seconds + 1e-12
    assert abs(rate - ahead.velocity) <= abs(faster) + 1e-12


def test_north_and_east_are_predicted_by_the_compass() -> None:
    """A drone that drives to the east at 0.5 m/s while its control heading is zero."""
    stack = Stack(vehicle="pioneer")
    ours = Predictor(stack.section("reference", Settings))
    seen = said.state(
        heading_navigation=pi / 2, surge_velocity=0.5, sway_velocity=0.0, north=0.0, east=0.0
    )
    ours.state(seen, 0)
    ours.reference(said.reference(surge=Motion(0.0, 0.5, 0.0, 0.0)), 0)
    found = ours.predict(SECOND)
    assert found is not None
    assert found.forward == pytest.approx(0.5)
    assert (found.north, found.east) == pytest.approx((0.0, 0.5), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("one_way_ms", [25, 250])
def test_the_predicted_now_is_at_most_a_third_as_far_off_as_the_delayed_picture(
    tmp_path: Path, one_way_ms: int
) -> None:
    """Over a dive with stops, turns and reversals. What is judged is the motion in between: the
    estimate's own error is in the delayed picture and in the prediction alike."""
    link, leg = tmp_path / "slow.toml", f"delay_ms = {one_way_ms}.0\n"
    link.write_text(f"[down]\n{leg}[up]\n{leg}")
    dive = Dive(STICKS, CHAIN, still_s=10.0, link=str(link))
    said = dive.heard(topics.PREDICTION, "topside")
    truths, states = dive.heard(topics.TRUTH), dive.heard(topics.STATE)
    dive.run(40.0)
    true = {m.stamp_ns // 10_000_000: m for m in truths}
    seen = {m.sensor_ns: m for m in states}
    errors = {"predicted": [0.0, 0.0], "delayed": [0.0, 0.0]}
    moving = [m for m in said if abs(m.depth_rate) > 0.1 or abs(m.yaw_rate) > 0.1]
    assert len(moving) > 100
    for m in moving:
        now, then = true.get(m.stamp_ns // 10_000_000), true.get(m.state_ns // 10_000_000)
        if now is None or then is None:
            continue
        picture = seen[m.state_ns]
        dived, turned = now.position[2] - then.position[2], now.heading - then.heading
        errors["predicted"][0] += (m.depth - picture.depth.value - dived) ** 2
        errors["predicted"][1] += (m.heading - picture.heading.value - turned) ** 2
        errors["delayed"][0] += dived**2
        errors["delayed"][1] += turned**2
    for axis in (0, 1):
        assert errors["predicted"][axis] ** 0.5 <= errors["delayed"][axis] ** 0.5 / 3


@pytest.mark.slow
def test_a_prediction_has_one_clock_whoever_reads_it() -> None:
    """The topside's, in which it is made and said; on board the gate has turned all of it."""
    dive = Dive(services=CHAIN, clocks={"drone": Skew(10**13)})
    above, below = dive.heard(topics.PREDICTION, "topside"), dive.heard(topics.PREDICTION)
    states = dive.heard(topics.STATE)
    dive.run(20.0)
    assert len(above) > 100
    assert len(below) > 100
    for m in above + below:
        assert m.stamp_ns - m.state_ns == pytest.approx(m.ahead_ms * 1e6, abs=2)
    assert all(0 < m.stamp_ns <= dive.host.now for m in above)
    for m in below:  # what is known of the other clock is good for a few milliseconds
        assert min(abs(m.state_ns - state.sensor_ns) for state in states) < 5_000_000
