"""What a dive's choices must be before anything starts."""

import re

from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack


def test_a_vehicle_is_called_as_its_file_calls_it() -> None:
    assert Stack(vehicle="bluerov2_heavy").vehicle_name == "bluerov2_heavy"
    example = deploy_file("vehicles", "pioneer").parents[2] / "examples/point_vehicle/vehicle.toml"
    assert Stack(vehicle=str(example)).vehicle_name == "point_vehicle"


@given(st.text())
def test_a_vehicles_name_is_a_chunk_of_a_key(name: str) -> None:
    stack = Stack()
    vars(stack)["_own_tree"] = {"vehicle": {"name": name}}
    assert re.fullmatch(r"[a-z0-9_]+", stack.vehicle_name)
