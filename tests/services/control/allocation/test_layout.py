"""Layouts: which axes a set of thrusters can drive, and which vehicles are refused."""

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from services.control.allocation import AXES, drivable, effect_matrix, require_pilotable
from services.marine.vehicle import Thruster, Vehicle

some = settings(max_examples=80, deadline=None)
coordinate = st.floats(-0.5, 0.5)
place = st.tuples(coordinate, coordinate, coordinate)
direction = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda d: sum(c * c for c in d) > 0.01)


def thruster(name: str, position: Vec3, direction: Vec3) -> Thruster:
    return Thruster(name=name, position=position, direction=direction, max_thrust=35.0)


def with_thrusters(vehicle: Vehicle, *thrusters: Thruster) -> Vehicle:
    return msgspec.structs.replace(vehicle, thruster=list(thrusters))


def strengths(vehicle: Vehicle) -> list[float]:
    return [min(-t.limits[0], t.limits[1]) for t in vehicle.thruster]


@pytest.fixture(scope="module")
def layouts(pioneer: Vehicle) -> st.SearchStrategy[Vehicle]:
    rows = st.lists(st.tuples(place, direction), min_size=1, max_size=8)
    return rows.map(
        lambda found: with_thrusters(
            pioneer, *[thruster(f"t{i}", p, d) for i, (p, d) in enumerate(found)]
        )
    )


@some
@given(st.data())
def test_each_driven_axis_can_be_had_alone_at_a_bearable_cost_and_no_more_than_the_rank(
    layouts: st.SearchStrategy[Vehicle], data: st.DataObject
) -> None:
    vehicle = data.draw(layouts)
    effect = effect_matrix(vehicle)
    axes = drivable(effect, strengths(vehicle))
    rows = effect[[AXES.index(axis) for axis in axes]]
    assert len(axes) <= np.linalg.matrix_rank(effect)
    arm = max(0.01, np.linalg.norm(effect[3:], axis=0).max())
    for index, axis in enumerate(axes):
        wanted = np.zeros(len(axes))
        wanted[index] = 1.0 if AXES.index(axis) < 3 else arm
        thrust = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        assert rows @ thrust == pytest.approx(wanted, abs=1e-9)
        assert np.linalg.norm(thrust) <= 10.0 + 1e-9


@some
@given(st.data())
def test_a_thruster_twice_on_the_same_line_counts_once(
    layouts: st.SearchStrategy[Vehicle], data: st.DataObject
) -> None:
    vehicle = data.draw(layouts)
    first = vehicle.thruster[0]
    along = data.draw(st.floats(-0.2, 0.2))
    moved = tuple(p + along * d for p, d in zip(first.position, first.direction, strict=True))
    twice = msgspec.structs.replace(first, position=moved, name="again")
    more = with_thrusters(vehicle, *vehicle.thruster, twice)
    rank = np.linalg.matrix_rank(effect_matrix(vehicle), tol=1e-9)
    assert len(drivable(effect_matrix(more), strengths(more))) <= rank


def test_a_few_millimetres_of_lever_are_not_an_axis(pioneer: Vehicle) -> None:
    """Two vertical thrusters 4 mm apart have full rank in pitch and no use for it."""
    front = thruster("front", (0.002, 0.0, 0.0), (0.0, 0.0, 1.0))
    rear = thruster("rear", (-0.002, 0.0, 0.0), (0.0, 0.0, 1.0))
    vehicle = with_thrusters(pioneer, *pioneer.thruster[:3], front, rear)
    assert "pitch" not in drivable(effect_matrix(vehicle), strengths(vehicle))


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (["port", "starboard", "lateral"], "heave"),
        (["port", "lateral", "vertical"], None),
        (["lateral", "vertical"], "surge"),
        (["vertical"], "surge and yaw"),
    ],
)
def test_a_refusal_names_the_axes(pioneer: Vehicle, names: list[str], missing: str | None) -> None:
    vehicle = with_thrusters(pioneer, *[t for t in pioneer.thruster if t.name in names])
    if missing is None:
        require_pilotable(vehicle)
        return
    with pytest.raises(ValueError, match=f"cannot drive {missing} independently"):
        require_pilotable(vehicle)
