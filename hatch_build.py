"""The wheel: one package, `lindy`, with the folders of this repository in it.

In the repository `services`, `messages`, `tools` and `deploy` are at the top. In the wheel they are
in `lindy/`, and every import of them says so. Nothing but import statements is changed: code that
needs the name of a module as a string takes it from `__name__` or `__package__`.
docs/decisions.md (0019)

The wheel of research/ is built by the same hook: it keeps its own place, and imports from `lindy/`.
"""

import ast
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

HOME = "lindy"
MOVED = ("messages", "services", "tools")


class OneName(BuildHookInterface[Any]):
    """Fills a wheel; an editable install takes the repository as it is."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        root = Path(self.root)
        self._rewritten = tempfile.TemporaryDirectory(prefix="lindy-wheel-")  # as long as the hook
        stays = self.config.get("stays", HOME)
        for folder in (stays, *self.config.get("moves", (*MOVED, "deploy"))):
            for file in sorted((root / folder).rglob("*")):
                if file.is_dir() or "__pycache__" in file.parts:
                    continue
                path = file.relative_to(root)
                place = path if folder == stays else HOME / path
                if file.suffix == ".py":
                    file = self._rewrite(file, place)
                build_data["force_include"][str(file)] = str(place)

    def _rewrite(self, file: Path, place: Path) -> Path:
        rewritten = Path(self._rewritten.name) / place
        rewritten.parent.mkdir(parents=True, exist_ok=True)
        try:
            rewritten.write_bytes(moved_imports(file.read_bytes()))
        except ValueError as error:
            raise ValueError(f"{file}: {error}") from None
        return rewritten


def moved_imports(source: bytes) -> bytes:
    """The same program with the imports of our packages from where they are in the wheel.

    Raises:
        ValueError: an import that binds the first part of a dotted name; it would be another one.
    """
    lines = source.splitlines(keepends=True)
    for line, column, old, new in sorted(_changes(ast.parse(source)), reverse=True):
        text = lines[line - 1]
        if not text[column:].startswith(old):
            raise ValueError(f"line {line}: expected {old.decode()!r} at column {column}")
        lines[line - 1] = text[:column] + new + text[column + len(old) :]
    return b"".join(lines)


def _changes(tree: ast.Module) -> list[tuple[int, int, bytes, bytes]]:
    """Line, column [bytes], what is there, what comes there."""
    found: list[tuple[int, int, bytes, bytes]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and _is_ours(node.module):
            found.append((node.lineno, node.col_offset, b"from ", f"from {HOME}.".encode()))
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if not _is_ours(alias.name):
                    continue
                if alias.asname is not None:
                    found.append((alias.lineno, alias.col_offset, b"", f"{HOME}.".encode()))
                elif alias.name in MOVED and len(node.names) == 1:
                    new = f"from {HOME} import ".encode()
                    found.append((node.lineno, node.col_offset, b"import ", new))
                else:
                    raise ValueError(f"line {node.lineno}: say `from … import {alias.name}`")
    return found


def _is_ours(module: str | None) -> bool:
    return module is not None and module.partition(".")[0] in MOVED
