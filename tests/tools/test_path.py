"""`lindy path`: JSON and CSV of a path file, and one sentence for each mistake in it."""

import json
from pathlib import Path
from typing import Any

import pytest

from services.runtime.config.errors import LindyError
from tools.path import path

CORNER = "waypoints = [[0, 0], [30, 0], [30, 30]]\n"


@pytest.fixture
def write(tmp_path: Path) -> Any:
    def to_file(text: str) -> str:
        file = tmp_path / "way.toml"
        file.write_text(text)
        return str(file)

    return to_file


def test_the_papers_path_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert path("fernandes") == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["total"] == pytest.approx(184.3011909924, abs=1e-9)
    assert shown["lengths"] == [part["length"] for part in shown["parts"]]
    kinds = ["line", "clothoids", "line", "clothoids", "line"]
    assert [part["kind"] for part in shown["parts"]] == kinds
    assert shown["parts"][1]["end"] == pytest.approx([41.9421089125, 27.0868366312], abs=1e-9)
    assert shown["parts"][0]["start"] == [0.0, 0.0]
    assert shown["max_curvature"] == 0.1
    assert shown["duration"] == pytest.approx(680.6454675, abs=1e-5)
    assert shown["smooth_yaw_deviation"] > 0


@pytest.mark.parametrize("name", ["fernandes", "inspection_box"])
def test_the_reference_as_csv_ends_at_the_last_way_point(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path(name)
    shown = json.loads(capsys.readouterr().out)
    path(name, dt=0.5)
    header, *lines = capsys.readouterr().out.splitlines()
    names = header.split(",")
    assert names[:5] == ["t", "s", "north", "east", "down"]
    table = [dict(zip(names, map(float, line.split(",")), strict=True)) for line in lines]
    assert [row["t"] for row in table] == [0.5 * k for k in range(len(table))]
    assert 0 <= table[-1]["t"] - shown["duration"] < 0.5
    assert table[-1]["s"] == pytest.approx(shown["total"], abs=1e-9)
    assert [table[-1]["north"], table[-1]["east"]] == pytest.approx(
        shown["parts"][-1]["end"], abs=1e-9
    )
    steepest = max(abs(row["curvature"]) for row in table)
    assert steepest == pytest.approx(shown["max_curvature"], rel=0.1)


def test_only_the_way_points_must_be_there(write: Any, capsys: pytest.CaptureFixture[str]) -> None:
    path(write(CORNER))
    shown = json.loads(capsys.readouterr().out)
    assert shown["max_curvature"] == 1 / 5
    assert len(shown["parts"]) == 3


def test_a_slower_turn_takes_longer(write: Any, capsys: pytest.CaptureFixture[str]) -> None:
    durations: list[float] = []
    for speeds in ("[0.3]", "[0.3, 0.3, 0.3]", "[0.3, 0.1, 0.3]"):
        path(write(f"{CORNER}speeds = {speeds}\n"))
        durations.append(json.loads(capsys.readouterr().out)["duration"])
    assert durations[1] == pytest.approx(durations[0], abs=1e-9)
    assert durations[2] > durations[0] + 50


def test_a_price_that_cannot_be_told_is_null(
    write: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    """Clothoids have a longer tangent than a smooth turn, so there are corners for one only."""
    path(write("waypoints = [[0, 0], [9.3, 0], [9.3, 9.3]]\nsmooth_yaw = true\n"))
    assert json.loads(capsys.readouterr().out)["smooth_yaw_deviation"] is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "waypoints"),
        ("waypoints = [[0, 0]]", "at least 2 way-points, found 1"),
        ("waypoints = [[0, 0], [0, 0]]", "0 m apart"),
        ("waypoints = [[0, 0], [inf, 0]]", "must be finite"),
        ("waypoints = [[0, 0], ['a', 0]]", "waypoints"),
        (CORNER + "min_radios = 3", "unknown key; did you mean 'min_radius'"),
        (CORNER + "min_radius = 0", "min_radius"),
        (CORNER + "min_radius = nan", "min_radius: expected a number >= 1e-06 m, found nan"),
        (CORNER + "min_radius = 20", "leg 1 (way-point 1 to 2) is 30 m long, its turns need"),
        (CORNER + "kind = 'round'", "kind"),
        (CORNER + "cruise = nan", "cruise: expected a number >= 1e-06 m/s, found nan"),
        (CORNER + "cruise = -0.3", "cruise"),
        (CORNER + "jerk = 0", "jerk"),
        (CORNER + "speeds = [0.3, 0.2]", "speeds: found 2, must be one, or one for each of the 3"),
        (
            CORNER + "speeds = [0.3, nan, 0.3]",
            "speeds number 2: expected a number >= 1e-06 m/s, found nan",
        ),
        (CORNER + "model = 'rm'", "model"),
        (CORNER + "model = 'fernandes'\nxi = 3", "xi"),
        ("waypoints = 3", "waypoints"),
        ("waypoints = [", "not valid TOML"),
    ],
)
def test_a_mistake_in_the_file_is_one_sentence_and_nothing_else(
    text: str, says: str, write: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(LindyError) as refused:
        path(write(text), dt=0.1)
    assert says in str(refused.value)
    assert "way.toml" in str(refused.value)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("dt", [0.0, -1.0, float("nan"), float("inf"), 1e-9])
def test_an_impossible_step_is_refused(
    dt: float, write: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(LindyError, match="--dt"):
        path(write(CORNER), dt=dt)
    assert capsys.readouterr().out == ""


def test_an_unknown_path_names_the_known_ones() -> None:
    with pytest.raises(LindyError, match="did you mean 'fernandes'"):
        path("fernandez")
