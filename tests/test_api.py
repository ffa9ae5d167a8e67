"""`lindy.api`: the same objects as inside, documented; and all that examples and docs import."""

import ast
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import lindy.api.messages
from lindy import api
from messages import topics
from messages.topic import AnyTopic

ROOT = Path(__file__).parents[1]
OURS = {"messages", "services", "tools", "lindy", "lindy_research", "tests"}
MODULES = ["lindy.api"] + [
    f"lindy.api.{p.stem}" for p in Path(api.__file__).parent.glob("[a-z]*.py")
]
EXPORTS = [(module, name) for module in MODULES for name in import_module(module).__all__]


def programs() -> Iterator[tuple[str, str]]:
    """Every program that a user reads: where, and its text."""
    for file in (ROOT / "examples").rglob("*.py"):
        yield str(file.relative_to(ROOT)), file.read_text(encoding="utf-8")
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        for number, block in enumerate(re.findall(r"^```python.*?\n(.*?)^```", text, re.S | re.M)):
            yield f"{page.name}, program {number}", block


@pytest.mark.parametrize(("where", "text"), [*programs()], ids=lambda value: str(value)[:40])
def test_a_program_for_users_imports_nothing_of_ours_but_the_api(where: str, text: str) -> None:
    for node in ast.walk(ast.parse(text)):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            own = name.partition(".")[0] in OURS
            assert not own or f"{name}.".startswith("lindy.api."), f"{where}: {name}"


def test_programs_are_found() -> None:
    assert len({where for where, _ in programs()}) > 10


@pytest.mark.parametrize(("module", "name"), EXPORTS)
def test_what_is_exported_is_documented(module: str, name: str) -> None:
    found = getattr(import_module(module), name)
    if inspect.isclass(found) or inspect.isfunction(found):
        assert inspect.getdoc(found)


@pytest.mark.parametrize("module", MODULES)
def test_the_pages_name_every_module(module: str) -> None:
    assert f"`{module}`" in (ROOT / "docs" / "library.md").read_text(encoding="utf-8")


def test_every_message_that_is_sent_can_be_imported() -> None:
    rows: tuple[AnyTopic, ...] = topics.ALL
    assert {row.message.__name__ for row in rows} <= set(lindy.api.messages.__all__)
    for row in rows:
        assert getattr(lindy.api.messages, row.message.__name__) is row.message
