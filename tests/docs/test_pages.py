"""What the pages of docs/ say is what the code, the data and the tests say."""

import ast
import re
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from tests.support.docs.written import FOLDER, PAGES
from tests.support.faults.figures import Figures
from tests.support.faults.goals import GOALS, CellRow
from tests.support.faults.page import COLUMNS, WORLDS, cells, flown, write_data
from tests.support.faults.page import page as faults_page


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_up_to_date(name: str) -> None:
    written = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    assert written == PAGES[name](), "make docs"


# The page about faults sums up the cells that are kept as data.


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
    assert line in faults_page(tmp_path)
    assert "**0 of 1**" in faults_page(tmp_path)
    assert "lindy-faults" not in (tmp_path / "faults_read.csv").read_text(encoding="utf-8")


# Each sentence that promises something stands where promises.toml says, and its tests exist.


ROOT = Path(__file__).parents[2]
PROMISES: list[dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("promises.toml").read_text(encoding="utf-8")
)["promise"]


def plain(text: str) -> str:
    """Without line breaks and emphasis."""
    return re.sub(r"\s+", " ", text.replace("**", ""))


def functions_in(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_each_sentence_is_on_its_page() -> None:
    pages = {
        page: plain((ROOT / page).read_text("utf-8")) for page in {p["page"] for p in PROMISES}
    }
    assert [p["says"] for p in PROMISES if plain(p["says"]) not in pages[p["page"]]] == []
    assert len({(p["page"], p["says"]) for p in PROMISES}) == len(PROMISES) > 40


def test_each_promise_has_tests_and_they_are_there() -> None:
    assert all(promise["tests"] for promise in PROMISES)
    named = {name for promise in PROMISES for name in promise["tests"]}
    there = {file: functions_in(file) for file in {name.split("::")[0] for name in named}}
    assert [
        name for name in sorted(named) if name.split("::")[1] not in there[name.split("::")[0]]
    ] == []


# Each row of the table of attacks names a test that there is, or is a limit the page names.


PAGE = (ROOT / "docs/security.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (?P<what>[^|]+) \| (?P<seen>[^|]+) \| (?P<proof>[^|]+) \|$", re.MULTILINE)
TEST = re.compile(r"`(test_\w+)`")


def attacks() -> list[re.Match[str]]:
    table = PAGE.partition("## Attacks")[2].partition("\n## ")[0]
    return [row for row in ROW.finditer(table) if row["what"] not in ("attack", "---")]


def test_every_attack_has_a_test_or_is_a_named_limit() -> None:
    files = list((ROOT / "tests").rglob("test_*.py"))
    code = "\n".join(path.read_text(encoding="utf-8") for path in files)
    there = {*re.findall(r"def (test_\w+)\(", code)}
    found = attacks()
    assert len(found) >= 25
    for row in found:
        named = TEST.findall(row["proof"])
        assert named or row["proof"].startswith("limit"), row[0]
        assert {*named} <= there, {*named} - there
