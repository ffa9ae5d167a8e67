"""Nothing of Lindy needs the package lindy-research, nor do its tests, examples and long runs."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("messages", "services", "tools", "tests", "examples")
KNOWN = ("services.runtime.config.errors", ROOT / "tools" / "__main__.py")


def imported(file: Path) -> Iterator[str]:
    text = file.read_text(encoding="utf-8")
    if "research" not in text and file != KNOWN[1]:
        return  # most: not worth taking apart
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def test_nothing_imports_research() -> None:
    files = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")]
    names = [(name, file) for file in files for name in imported(file)]
    assert KNOWN in names
    wrong = ("lindy_research", "research")
    assert [(n, str(f)) for n, f in names if n.partition(".")[0] in wrong] == []
