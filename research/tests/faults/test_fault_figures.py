"""What is measured in a cell: each figure of an undisturbed dive is spotless, and each disturbance
shows in the figure that is meant for it."""

from collections.abc import Callable

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.pilot import PilotAnswer
from messages.reference import Motion, Reference
from messages.vehicle import Actuation, Truth, VehicleStatus
from tests.support.faults.figures import (
    SECOND,
    STEP_NS,
    depth_error,
    disarmed,
    figures,
    jerk_ratio,
    recovered,
)
from tests.support.faults.observed import Observed

COUNT = 300  # instants
STILL = Motion(0.0, 0.0, 0.0, 0.0, 0.5)
END = COUNT * STEP_NS
At = Callable[[float], float]  # of the time [s]


def truth(t: int, depth: float) -> Truth:
    return Truth(
        stamp_ns=t, position=(0.0, 0.0, depth), attitude=(1.0, 0.0, 0.0, 0.0),
        velocity=(0.0, 0.0, 0.0), angular_rate=(0.0, 0.0, 0.0), depth_rate=0.0, roll=0.0,
        pitch=0.0, heading=0.0, on_floor=False,
    )  # fmt: skip


def reference(t: int, depth: Motion = STILL) -> Reference:
    return Reference(
        stamp_ns=t, sensor_ns=t, pilot_ns=t, armed=True, depth=depth, heading=STILL,
        surge_force=0.0, sway_force=0.0,
    )  # fmt: skip


def actuation(t: int, newtons: float = 1.0) -> Actuation:
    return Actuation(
        stamp_ns=t, thrust=(newtons,), actuated_ns=t, sensor_ns=t, pilot_ns=t, stale=False, power=0
    )


def dive(depth: At = lambda _: 2.0, speed: At = lambda _: 0.0) -> Observed:
    """Held at a depth [m], with a reference that moves with a speed [m/s]."""
    times = [n * STEP_NS for n in range(COUNT)]
    return Observed(
        truth=[truth(t, depth(t / SECOND)) for t in times],
        references=[
            reference(t, msgspec.structs.replace(STILL, velocity=speed(t / SECOND))) for t in times
        ],
        actuations=[actuation(t) for t in times],
        statuses=[VehicleStatus(stamp_ns=t, activity="piloted", armed=True) for t in times[::20]],
    )


def test_an_undisturbed_dive_has_spotless_figures() -> None:
    found = figures(dive(), 0, END, holds_depth=True)
    assert (found.depth_error, found.jerk_ratio, found.stale, found.recovered) == (0.0, 0.0, 0, 0.0)
    assert (found.pilot_lost, found.thrust_zero, found.announced) == (None, None, None)
    assert found.still_armed


@given(speed=st.floats(-0.5, 0.5), away=st.floats(-1.0, 1.0))
def test_the_depth_error_is_the_distance_from_where_the_reference_leads(
    speed: float, away: float
) -> None:
    seen = dive(lambda t: 2.0 + speed * t + (away if t > 1.0 else 0.0), lambda _: speed)
    assert depth_error(seen, 0) == pytest.approx(abs(away), abs=1e-6)


def test_a_jump_of_the_reference_is_no_motion_and_shows_as_a_depth_that_was_left() -> None:
    seen = dive(lambda t: 2.0 if t < 1.0 else 3.0)
    jumped = [
        msgspec.structs.replace(r, depth=msgspec.structs.replace(STILL, position=3.0))
        for r in seen.references[100:]
    ]
    seen.references[100:] = jumped
    assert depth_error(seen, 0) == pytest.approx(1.0)


@given(step=st.floats(0.001, 1.0))
def test_a_step_of_the_acceleration_is_a_jerk_although_the_reference_says_none(step: float) -> None:
    after = reference(STEP_NS, msgspec.structs.replace(STILL, acceleration=step))
    assert jerk_ratio([reference(0), after]) == pytest.approx(step / 0.01 / 0.5)


@pytest.mark.parametrize(
    ("change", "count"),
    [
        ({"pilot_ns": -400_000_000}, 1),
        ({"pilot_ns": -290_000_000}, 0),
        ({"actuated_ns": -250_000_000, "pilot_ns": None}, 1),
        ({"actuated_ns": -190_000_000, "pilot_ns": None}, 0),
        ({"actuated_ns": -250_000_000, "stale": True}, 0),
    ],
)
def test_a_command_beyond_its_life_is_stale(change: dict[str, int], count: int) -> None:
    seen = dive()
    late = {name: v + END if name.endswith("_ns") and v else v for name, v in change.items()}
    seen.actuations.append(msgspec.structs.replace(actuation(END), **late))
    assert figures(seen, 0, END, holds_depth=True).stale == count


def test_the_pilot_is_in_control_again_when_the_last_of_everything_bad_is_over() -> None:
    seen = dive()
    seen.actuations[:50] = [msgspec.structs.replace(a, stale=True) for a in seen.actuations[:50]]
    assert recovered(seen, 0, END) == pytest.approx(0.5)
    seen.statuses[4] = msgspec.structs.replace(seen.statuses[4], failsafe="pilot_lost")
    assert recovered(seen, 0, END) == pytest.approx(1.0)
    assert recovered(seen, 0, 2 * END) is None, "nobody actuates any more"
    seen.statuses[-1] = msgspec.structs.replace(seen.statuses[-1], armed=False)
    assert recovered(seen, 0, END) is None


def test_who_is_away_from_the_very_beginning_is_in_control_when_it_is_back() -> None:
    seen = dive()
    seen.actuations = seen.actuations[70:]
    assert recovered(seen, 0, END) == pytest.approx(0.7)


def test_a_disarm_counts_when_thrust_is_zero_for_good_and_somebody_has_granted_it() -> None:
    seen = dive()
    seen.actuations[30:] = [actuation(a.stamp_ns, 0.0) for a in seen.actuations[30:]]
    assert disarmed(seen, 0, END) is None, "nobody has granted it: the drone may just be at rest"
    seen.answers.append(PilotAnswer(stamp_ns=STEP_NS, id="x", accepted=True))
    assert disarmed(seen, 0, END) == pytest.approx(0.29)
    seen.actuations.append(actuation(END))
    assert disarmed(seen, 0, END) is None
