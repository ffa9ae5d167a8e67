"""The tour: each step is ticked off when the drone has done it, and not before."""

from math import radians

from hypothesis import given
from hypothesis import strategies as st

from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.vehicle import Activity, VehicleStatus
from tools.tour import END, STEPS, SeenDive, Tour

S = 1_000_000_000  # [ns]


def seen(
    now_s: float = 0.0,
    *,
    armed: bool = True,
    doing: Activity = "piloted",
    depth: float = 0.2,
    rate: float = 0.0,
    heading_deg: float = 0.0,
    wanted: float = 0.0,
) -> SeenDive:
    none = Estimate(0.0, 0.01)
    state = VehicleState(
        stamp_ns=0, sensor_ns=0, phase="running", depth=Estimate(depth, 0.01),
        depth_rate=Estimate(rate, 0.01), depth_acceleration=none, attitude=(1.0, 0.0, 0.0, 0.0),
        roll=none, pitch=none, heading=Estimate(radians(heading_deg), 0.01),
        heading_navigation=None, yaw_rate=none,
    )  # fmt: skip
    reference = Reference(
        stamp_ns=0, sensor_ns=0, pilot_ns=0, armed=armed, depth=Motion(1.2, wanted, 0.0, 0.0),
        heading=Motion(0.0, 0.0, 0.0, 0.0), surge_force=0.0, sway_force=0.0,
    )  # fmt: skip
    status = VehicleStatus(stamp_ns=0, activity=doing, armed=armed, pilot="page")
    return SeenDive(status, state, reference, round(now_s * S))


def test_a_dive_as_it_should_be_ticks_every_step_once() -> None:
    tour = Tour()
    dive = [
        seen(armed=False), seen(), seen(depth=1.2, rate=0.3, wanted=0.3),
        seen(2.0, depth=1.21), seen(2.5, depth=1.21), seen(3.1, depth=1.21),
        seen(4.0), seen(5.0, heading_deg=85.0), seen(6.0, doing="stopping"),
        seen(7.0, doing="ready"), seen(8.0, depth=0.6), seen(9.0, armed=False),
    ]  # fmt: skip
    steps = list[int]()
    for each in dive:
        tour.see(each)
        steps.append(tour.at)
    assert steps == [0, 1, 2, 2, 2, 3, 3, 4, 5, 6, 7, 8]
    assert tour.over
    assert tour.lines()[-1] == END
    assert "it stands 1.0 cm below its reference" in tour.lines()[2]


@given(st.lists(st.builds(
    seen, st.floats(0.0, 100.0), armed=st.booleans(), depth=st.floats(0.0, 3.0),
    doing=st.sampled_from(["ready", "piloted", "stopping"]), rate=st.floats(-1.0, 1.0),
    heading_deg=st.floats(-200.0, 200.0), wanted=st.floats(-1.0, 1.0),
), max_size=30))  # fmt: skip
def test_it_goes_forward_a_step_at_a_time_and_always_shows_every_step(dive: list[SeenDive]) -> None:
    tour = Tour()
    for each in sorted(dive, key=lambda one: one.now):
        before = tour.at
        tour.see(each)
        assert tour.at - before in (0, 1)
        assert len(tour.results) == tour.at
        assert len(tour.lines()) == len(STEPS) + tour.over
