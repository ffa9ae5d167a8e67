"""A map that cannot be meant is one sentence that says what to write."""

from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY
from tools.importing.log_file import LogSource, chosen, missing, untaken
from tools.importing.map_file import TARGETS, read_map

GOOD = """
about = "one IMU"
vehicle = "pioneer"
[[take]]
topic = "imu"
as = "sensor/imu"
{axes}
[take.fields]
specific_force = {{ from = ["a.0", "a.1", "a.2"], unit = "{unit}" }}
angular_rate = {{ from = {rate}, unit = "deg/s" }}
"""
RATE = '["g.0", "g.1", "g.2"]'


def written(folder: Path, *, axes: str = "", unit: str = "g", rate: str = RATE) -> str:
    path = folder / "map.toml"
    path.write_text(GOOD.format(axes=axes, unit=unit, rate=rate))
    return str(path)


@pytest.mark.parametrize("path", [*DEPLOY.glob("imports/*.toml")], ids=lambda path: path.stem)
def test_the_shipped_maps_are_right(path: Path) -> None:
    found, _ = read_map(path.stem)
    assert {taken.as_ for taken in found.take} <= {*TARGETS}


def test_axes_may_be_turned(tmp_path: Path) -> None:
    found, _ = read_map(written(tmp_path, axes="axes = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]"))
    assert found.take[0].rotation[0] == (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"axes": "axes = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]"}, "left-handed (determinant -1)"),
        ({"axes": "axes = [[1, 0, 0], [1, 0, 0], [0, 0, 1]]"}, "at right angles to each other"),
        ({"axes": 'axes = "NED"'}, 'axes is "NED", expected FRD or FLU or a rotation'),
        ({"unit": "mbar"}, "unit is 'mbar', expected one of acceleration: m/s², mm/s², g, mg"),
        ({"rate": '["g.0"]'}, "angular_rate: from has 1 names, expected 3"),
        ({"axes": 'clock = "board"'}, 'clock is "board", but no field is named by stamp'),
    ],
)
def test_a_wrong_map_says_what_to_write(tmp_path: Path, changes: dict[str, str], said: str) -> None:
    with pytest.raises(LindyError) as error:
        read_map(written(tmp_path, **changes))
    assert said in str(error.value)


def test_two_sources_of_one_sensor_are_refused() -> None:
    both = {name: LogSource("sensor_msgs/msg/Imu", 5) for name in ("/imu/raw", "/imu/data")}
    with pytest.raises(LindyError) as error:
        chosen(read_map("ros")[0], both, "a.bag")
    assert "/imu/raw and /imu/data are both sensor_msgs/msg/Imu" in str(error.value)
    assert 'write topic = "/imu/raw"' in str(error.value)


def test_a_source_without_messages_is_missing() -> None:
    sources = {"a": LogSource("sensor_msgs/msg/Imu", 5), "b": LogSource("sensor_msgs/msg/Joy", 0)}
    found = chosen(read_map("ros")[0], sources, "a.bag")
    assert [*found] == ["a"]
    assert missing(found) == [key for key in TARGETS if key != "sensor/imu"]


def test_what_the_map_does_not_take_is_named_the_likeliest_first() -> None:
    sources = {
        "/camera": LogSource("sensor_msgs/msg/Image", 5),
        "/imu": LogSource("sensor_msgs/msg/Imu", 5),
        "/silent": LogSource("std_msgs/msg/String", 0),
        "/sensor/pressure": LogSource("std_msgs/msg/Float64", 5),
    }
    found = chosen(read_map("ros")[0], sources, "a.bag")
    assert untaken(found, sources) == [
        "/sensor/pressure (std_msgs/msg/Float64)",
        "/camera (sensor_msgs/msg/Image)",
    ]


def test_columns_that_the_map_does_not_take_are_named() -> None:
    columns = frozenset({"publish_ns", "pressure", "temperature", "depth [m]"})
    sources = {"sensor_pressure": LogSource("table", 5, columns)}
    found = chosen(read_map("tables")[0], sources, "sensor_pressure.csv")
    assert untaken(found, sources) == ["depth [m] in sensor_pressure"]
