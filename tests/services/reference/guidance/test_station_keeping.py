"""A place in NED moved by velocities in the body: smooth, exact, at rest where it was let go."""

from itertools import pairwise
from math import cos, dist, hypot, pi, sin

from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.attitude import turned
from services.reference.guidance.station_keeping import GroundMotion, StationKeeping
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample

PLACE, YAW = Limits(1.0, 0.4), Limits(4.0, 1.5)
FASTEST, TURNING = 0.4, 1.05  # [m/s], [rad/s]
stick = st.floats(-1.0, 1.0)
angle = st.floats(-7.0, 7.0)
moves = st.lists(st.tuples(stick, stick, stick, st.floats(0.05, 1.5)), min_size=1, max_size=5)
Track = list[tuple[Sample, Sample]]


def held(heading: float, ground: GroundMotion) -> tuple[StationKeeping, Ramp]:
    place, yaw = StationKeeping(PLACE), Ramp(YAW)
    yaw.rest(heading, 0.0)
    place.take_measured(ground, 0.0)
    return place, yaw


def fly(
    place: StationKeeping, yaw: Ramp, plan: list[tuple[float, float, float, float]], dt: float
) -> tuple[float, Track]:
    """Sticks (surge, sway, yaw, seconds) one after the other; the time and what was seen."""
    t, seen = 0.0, [place.now]
    for surge, sway, turn, seconds in plan:
        for i in range(max(1, round(seconds / dt))):
            if i == 0:
                yaw.aim(turn * TURNING, t)
                place.aim((surge * FASTEST, sway * FASTEST), t)
            t += dt
            place.step(yaw.at(t), place.offset, t)
            seen.append(place.now)
    return t, seen


@settings(max_examples=30, deadline=None)
@given(moves, angle, angle, st.tuples(stick, stick))
def test_position_velocity_and_acceleration_never_step(
    plan: list[tuple[float, float, float, float]],
    heading: float,
    offset: float,
    velocity: tuple[float, float],
) -> None:
    dt = 0.01
    place, yaw = held(heading, GroundMotion((3.0, -2.0), velocity, offset))
    _, seen = fly(place, yaw, plan, dt)
    fastest = hypot(*velocity) + 2 * FASTEST
    acceleration = 2 * PLACE.acceleration + TURNING * fastest
    jerk = 2 * PLACE.jerk + 2 * TURNING * PLACE.acceleration
    jerk += (YAW.acceleration + TURNING**2) * fastest
    for before, after in pairwise(seen):
        for a, b in zip(before, after, strict=True):
            mean = (a.velocity + b.velocity) / 2
            assert abs(b.position - a.position - mean * dt) <= jerk * dt**3 / 12 + 1e-12
            mean = (a.acceleration + b.acceleration) / 2
            assert abs(b.velocity - a.velocity - mean * dt) <= jerk * dt**2 / 2
        for name, most in (("velocity", acceleration), ("acceleration", jerk)):
            change = dist(*([getattr(s, name) for s in at] for at in (before, after)))
            assert change <= most * dt + 1e-9
        assert hypot(*(s.jerk for s in after)) <= jerk + 1e-9


@settings(max_examples=20, deadline=None)
@given(moves, angle)
def test_let_go_it_comes_to_rest_and_stays(
    plan: list[tuple[float, float, float, float]], heading: float
) -> None:
    place, yaw = held(heading, GroundMotion((0.0, 0.0), (0.0, 0.0), 0.0))
    _, seen = fly(place, yaw, [*plan, (0.0, 0.0, 0.0, 4.0)], 0.01)
    end, earlier = seen[-1], seen[-50]
    assert all(s.velocity == s.acceleration == s.jerk == 0.0 for s in end)
    assert end == earlier


@settings(max_examples=20, deadline=None)
@given(stick, stick, angle, angle)
def test_with_a_standing_heading_it_is_the_closed_form_of_the_stick_turned_to_north(
    surge: float, sway: float, heading: float, offset: float
) -> None:
    place, yaw = held(heading, GroundMotion((1.0, 2.0), (0.0, 0.0), offset))
    t, seen = fly(place, yaw, [(surge, sway, 0.0, 1.23)], 0.01)
    along = place._stick.at(t)  # pyright: ignore[reportPrivateUsage]
    north, east = turned((along[0].position, along[1].position), heading + offset)
    # Where two segments of a plan meet inside a step, the end correction is not exact.
    assert dist((north + 1.0, east + 2.0), [s.position for s in seen[-1]]) < 1e-6


def test_north_is_corrected_only_while_nothing_moves() -> None:
    place, yaw = held(0.0, GroundMotion((0.0, 0.0), (0.0, 0.0), 0.0))
    place.step(yaw.at(0.1), 0.5, 0.1)
    assert place.offset == 0.5
    place.aim((0.4, 0.0), 0.1)
    for i in range(11, 400):
        place.step(yaw.at(i / 100), 0.5 + pi / 2, i / 100)
    north, east = place.now
    assert abs(north.velocity - 0.4 * cos(0.5)) < 1e-12
    assert abs(east.velocity - 0.4 * sin(0.5)) < 1e-12
