"""What a conversion cuts is counted, not only cut."""

from math import cos, pi, sin
from types import SimpleNamespace

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.control import ThrusterCommand
from messages.pilot import PilotCommand
from messages.vehicle import Actuation, VehicleEstimate
from services.marine.attitude import from_euler
from tools.importing.conversion import Conversion
from tools.importing.log_file import LogRow, cell
from tools.importing.map_file import TakenMessage

BEGAN_NS = 1_700_000_000_000_000_000  # [ns] UTC
AXES = ("surge", "sway", "heave", "yaw")


def converted(
    as_: str, fields: dict[str, object], numbers: list[float]
) -> tuple[list[object], dict[str, int]]:
    """The messages of rows `x`, and how often each oddity was counted."""
    taken = msgspec.convert({"as": as_, "topic": "log", "fields": fields}, TakenMessage)
    rows = [
        LogRow("log", SimpleNamespace(x=x), BEGAN_NS + k * 20_000_000)
        for k, x in enumerate(numbers)
    ]
    conversion = Conversion(rows, {"log": [taken]})
    found = [one.message for one in conversion.messages()]
    return [*found], {each.what: each.count for each in conversion.oddities.all()}


@given(st.lists(st.floats(-1.1, 1.1), min_size=1, max_size=30))
def test_each_stick_beyond_its_end_is_cut_and_counted(sticks: list[float]) -> None:
    found, odd = converted("pilot/command", {axis: {"from": ["x"]} for axis in AXES}, sticks)
    cut = [max(-1.0, min(1.0, x)) for x in sticks]
    assert [m.surge for m in found if isinstance(m, PilotCommand)] == cut
    beyond = sum(abs(x) > 1.0 for x in sticks)
    assert odd.get("a stick beyond its end [of full], cut to its end", 0) == beyond


def test_a_number_beyond_a_curve_is_taken_as_at_its_end_and_counted() -> None:
    curve = [[1100, -40.0], [1500, 0.0], [1900, 50.0]]
    fields: dict[str, object] = {"thrust": {"from": ["x"], "unit": "N", "curve": curve}}
    found, odd = converted("vehicle/actuation", fields, [1000.0, 1300.0, 1900.0, 2000.0])
    assert [m.thrust for m in found if isinstance(m, Actuation)] == [
        (-40.0,),
        (-20.0,),
        (50.0,),
        (50.0,),
    ]
    assert odd["a number beyond the ends of its curve, taken as at the end"] == 2


angles = st.floats(-3.0, 3.0)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_an_attitude_of_ros_has_our_angles(roll: float, pitch: float, heading: float) -> None:
    """In ROS pitch is positive down and yaw counter-clockwise from east (REP 103)."""
    q = from_euler(roll, -pitch, pi / 2 - heading)
    take = {
        "as": "vehicle/estimate", "topic": "log", "axes": "FLU", "world": "ENU",
        "fields": {"attitude": {"from": ["q.0", "q.1", "q.2", "q.3"]}},
    }  # fmt: skip
    row = LogRow("log", SimpleNamespace(q=q), BEGAN_NS)
    [found] = Conversion([row], {"log": [msgspec.convert(take, TakenMessage)]}).messages()
    ours = found.message
    assert isinstance(ours, VehicleEstimate)
    assert ours.roll is not None
    assert ours.pitch is not None
    assert ours.heading is not None
    assert (cos(ours.roll), sin(ours.roll)) == pytest.approx((cos(roll), sin(roll)), abs=1e-6)
    assert ours.pitch == pytest.approx(pitch, abs=1e-6)
    assert cos(ours.heading - heading) == pytest.approx(1.0, abs=1e-6)


@given(st.lists(st.floats(0.1, 6.0), min_size=1, max_size=20))
def test_an_autopilot_that_is_wrong_is_left_out_and_counted(rolls: list[float]) -> None:
    """It is no reason to refuse the sensors."""
    numbers = [*rolls, *[100.0 + k for k in range(200)], *rolls]
    found, odd = converted("vehicle/estimate", {"roll": {"from": ["x"], "unit": "rad"}}, numbers)
    assert [m.roll for m in found if isinstance(m, VehicleEstimate)] == rolls
    assert odd["roll cannot be [rad], left out"] == len(numbers) - len(rolls)


def test_commands_are_armed_as_the_status_says() -> None:
    arm = {"as": "vehicle/status", "topic": "arm", "fields": {"armed": {"from": ["x"]}}}
    curve = [[1100, -40.0], [1500, 0.0], [1900, 50.0]]
    thrust = {"from": ["x"], "unit": "N", "curve": curve}
    out = {"as": "control/thrusters", "topic": "out", "fields": {"thrust": thrust}}
    taken = {name: [msgspec.convert(each, TakenMessage)] for name, each in
             (("arm", arm), ("out", out))}  # fmt: skip
    said = [("out", 1500.0), ("arm", 1.0), ("out", 1700.0), ("arm", 0.0), ("out", 1500.0)]
    rows = [
        LogRow(source, SimpleNamespace(x=x), BEGAN_NS + k * 10**7)
        for k, (source, x) in enumerate(said)
    ]
    found = [one.message for one in Conversion(rows, taken).messages()]
    commands = [one for one in found if isinstance(one, ThrusterCommand)]
    assert [(one.armed, one.thrust) for one in commands] == [
        (False, (0.0,)), (True, (25.0,)), (False, (0.0,)),
    ]  # fmt: skip


def test_the_forces_of_three_thrusters_are_no_vector() -> None:
    """They are not turned by the axes of the log."""
    fields = {"thrust": {"from": ["x", "x", "x"], "unit": "N"}}
    part = {"as": "vehicle/actuation", "topic": "log", "axes": "FLU", "fields": fields}
    row = LogRow("log", SimpleNamespace(x=3.0), BEGAN_NS)
    [found] = Conversion([row], {"log": [msgspec.convert(part, TakenMessage)]}).messages()
    assert isinstance(found.message, Actuation)
    assert found.message.thrust == (3.0, 3.0, 3.0)


def test_a_row_without_what_tells_it_apart_is_of_another_message() -> None:
    """An empty cell in a column of `only` had ended the import with a traceback."""
    fields = {"pressure": {"from": ["p"], "unit": "Pa"}}
    part = {"as": "sensor/pressure", "topic": "log", "only": {"kind": 1.0}, "fields": fields}
    cells = [{"kind": 1.0, "p": 1e5}, {"kind": None, "p": 1e5}, {"kind": 2.0, "p": 1e5}]
    rows = [LogRow("log", each, BEGAN_NS + k * 10**7) for k, each in enumerate(cells)]
    taken = {"log": [msgspec.convert(part, TakenMessage)]}
    assert len([*Conversion(rows, taken, take=cell).messages()]) == 1
