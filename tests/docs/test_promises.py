"""Each sentence that promises something stands where promises.toml says, and its tests exist."""

import ast
import re
import tomllib
from pathlib import Path
from typing import Any

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
