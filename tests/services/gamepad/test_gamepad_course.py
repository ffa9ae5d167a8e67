"""A path file as a course."""

from pathlib import Path

import pytest

from messages.pilot import Course
from services.gamepad.io.path_file import course_of
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY

WAY = "waypoints = [[0, 0, 2], [9, 0, 2], [9, 9, 3]]\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "way.toml"


def test_what_a_file_leaves_out_is_the_courses_own_default(file: Path):
    file.write_text(WAY)
    points = ((0.0, 0.0, 2.0), (9.0, 0.0, 2.0), (9.0, 9.0, 3.0))
    assert course_of(file) == Course(waypoints=points)


def test_every_key_reaches_its_own_field(file: Path):
    file.write_text(
        WAY + 'min_radius = 2\nkind = "interpolating"\ncruise = 0.4\nacceleration = 0.1\n'
        'jerk = 0.6\nmodel = "mjvr"\nsmooth_yaw = true\naccel_time = 7.0\n'
    )
    course = course_of(file)
    assert course.min_radius == 2.0
    assert course.kind == "interpolating"
    assert (course.cruise, course.acceleration, course.jerk) == (0.4, 0.1, 0.6)


def test_the_papers_path_is_refused_because_of_its_model():
    with pytest.raises(LindyError, match=r"fernandes\.toml: model is 'fernandes'; only a path"):
        course_of(DEPLOY / "paths" / "fernandes.toml")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("cruise = 0.3\n", "waypoints"),
        ("waypoints = [[0, 0]]\n", "way.toml:1: waypoints: expected an array of length >= 2"),
        ("waypoints = [[0, 0], [1]]\n", "waypoints number 2: expected an array of length >= 2"),
        ("waypoints = [[0, 0], [1, nan]]\n", "waypoints number 2, number 2: expected a number"),
        (WAY + "cruse = 0.3\n", "way.toml:2: cruse: unknown key; did you mean 'cruise'"),
        (WAY + "cruise = -0.3\n", "way.toml:2: cruise: expected a number >= 1e-06, found -0.3"),
        (WAY + "jerk = nan\n", "jerk: expected a number"),
        (WAY + "min_radius = inf\n", "min_radius: expected a number"),
        (WAY + 'kind = "round"\n', "kind: invalid enum value 'round'"),
        (WAY + 'model = "mjrv"\n', "model: invalid enum value 'mjrv'"),
        (WAY + 'model = "fernandes"\n', "only a path with model = 'mjvr' can be followed"),
        (WAY + "speeds = [0.1]\n", "has one speed; use cruise instead"),
        ("waypoints = \n", "not valid TOML"),
    ],
)
def test_a_mistake_is_one_sentence(file: Path, text: str, says: str):
    file.write_text(text)
    with pytest.raises(LindyError) as caught:
        course_of(file)
    assert str(file) in str(caught.value)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
