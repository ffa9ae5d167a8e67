"""Settings become parameters under the names that `--set` uses."""

from services.foxglove.core import parameters
from services.runtime.config.settings import override, read_toml
from services.runtime.config.stack import Stack


def test_every_setting_of_a_vehicle_file_is_a_parameter_of_its_own_name():
    tree = read_toml(Stack().vehicle_path)
    override(tree, ["control.depth.kp=3", "simulator.seed=true", "x.words=[[1, 2], []]"])
    found = parameters(tree)
    assert found["control.depth.kp"] == 3
    assert found["simulator.seed"] is True
    assert found["vehicle.mass"] == 8.6
    assert found["vehicle.thruster.1.name"] == "starboard"
    assert found["vehicle.size.2"] == 0.354
    assert (found["x.words.0.1"], "x.words.1" in found) == (2, False)
    assert all(isinstance(value, bool | int | float | str) for value in found.values())
