"""An option stays where a shipped file sets it, a page explains it, or a test shows that somebody
needs it. The others are named constants."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast, get_args

import msgspec

from services.runtime.hosts.registry import Registry
from tools.checks import known_tables

ROOT = Path(__file__).parents[1]
SHIPPED = [*ROOT.glob("deploy/**/*.toml"), *ROOT.glob("examples/**/*.toml")]
PAGES = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/**/*.md"), ROOT / "README.md"]


def structs(kind: Any) -> Iterator[type[msgspec.Struct]]:
    """The tables that a field of this type can hold."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind
    for part in get_args(kind):
        yield from structs(part)


def options(kind: Any, seen: set[type]) -> Iterator[tuple[str, str]]:
    """(table, field) of every field with a default, in this table and in those within."""
    for table in set(structs(kind)) - seen:
        seen.add(table)
        for field in msgspec.structs.fields(table):
            if not field.required:
                yield table.__name__, field.encode_name
            yield from options(field.type, seen)


def keys_of(tree: Any) -> Iterator[str]:
    """All keys of a TOML file."""
    parts: list[Any] = []
    if isinstance(tree, dict):
        table = cast(dict[str, Any], tree)
        yield from table
        parts = [*table.values()]
    elif isinstance(tree, list):
        parts = cast(list[Any], tree)
    for part in parts:
        yield from keys_of(part)


def test_every_option_is_set_in_a_shipped_file_or_explained_or_needed_by_a_test() -> None:
    named = {key for file in SHIPPED for key in keys_of(tomllib.loads(file.read_text()))}
    named |= {word for page in PAGES for word in re.findall(r"[a-z_0-9]+", page.read_text())}
    tests = "\n".join(file.read_text() for file in ROOT.glob("tests/**/*.py"))
    named |= set(re.findall(r"([a-z_0-9]+)=", tests))
    seen = set[type]()
    found = [
        (section, *option)
        for section, kind in known_tables(Registry.read()).items()
        for option in options(kind, seen)
    ]
    assert len(found) > 100
    assert [option for option in found if option[-1] not in named] == []
