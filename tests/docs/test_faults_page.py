"""The page about faults sums up the cells that are kept as data."""

from collections import Counter
from pathlib import Path

from tests.support.faults.figures import Figures
from tests.support.faults.goals import GOALS, CellRow
from tests.support.faults.page import COLUMNS, WORLDS, cells, flown, page, write_data


def test_the_cells_miss_as_many_goals_as_are_counted() -> None:
    missed = Counter(
        (goal, cell["world"]) for cell in cells() for goal in cell["missed"].split(", ")
    )
    assert {(count.goal, count.world) for count in flown().goals} == {
        (goal.name, world) for goal in GOALS for world in WORLDS
    }
    for count in flown().goals:
        assert count.judged - count.met == missed[count.goal, count.world], count


def test_each_cell_is_there_once() -> None:
    every = [(cell["world"], cell["mode"], cell["fault"]) for cell in cells()]
    assert len(set(every)) == len(every) >= flown().planned
    assert tuple(cells()[0]) == COLUMNS


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    figures = Figures(
        depth_error=0.5, jerk_ratio=None, stale=0, pilot_lost=None, thrust_zero=0.21,
        recovered=0.4, announced=0.04, failsafes=("state_lost",), restarted=("control",),
        texts=("control is started again", "of /tmp/lindy-faults-1/dive"), still_armed=True,
    )  # fmt: skip
    row = CellRow("manual", "kill", "kill -9 control", figures, {"depth": False})
    write_data([row], 1, "in a test", tmp_path)
    (cell,) = cells(tmp_path)
    assert (cell["fault"], cell["missed"], cell["thrust_zero_s"]) == (row.fault, "depth", "0.21")
    line = "| a service on board dies | state lost, started again | 0.0 | 0.4 | depth 1 |"
    assert line in page(tmp_path)
    assert "**0 of 1**" in page(tmp_path)
    assert "lindy-faults" not in (tmp_path / "faults_read.csv").read_text(encoding="utf-8")
