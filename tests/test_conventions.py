"""What holds in the whole project: names, imports, options, and the table of events."""

import ast
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, cast, get_args

import msgspec

from messages import events
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables

ROOT = Path(__file__).parents[1]
# The table of a vehicle file that a service reads: every service has one, under this name.
KNOWN = {"Settings"}


@cache
def several() -> set[str]:
    """Names of public classes that more than one file defines."""
    names = Counter(
        name
        for folder in ("messages", "services", "tools")
        for file in (ROOT / folder).rglob("*.py")
        for name in re.findall(r"^class ([A-Za-z]\w*)", file.read_text(encoding="utf-8"), re.M)
    )
    assert names["Message"] == 1, "the search finds classes"
    return {name for name, count in names.items() if count > 1}


def test_no_class_name_is_used_twice_that_was_not_before() -> None:
    assert several() - KNOWN == set()


def test_a_name_that_is_unique_by_now_is_taken_off_the_list() -> None:
    assert KNOWN - several() == set()


# Nothing of Lindy needs the package lindy-research, nor do its tests, examples and long runs.


FOLDERS = ("messages", "services", "tools", "tests", "examples")
BY_MAIN = ("services.runtime.config.errors", ROOT / "tools" / "__main__.py")


def imported(file: Path) -> Iterator[str]:
    text = file.read_text(encoding="utf-8")
    if "research" not in text and file != BY_MAIN[1]:
        return  # most: not worth taking apart
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def test_nothing_imports_research() -> None:
    files = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")]
    names = [(name, file) for file in files for name in imported(file)]
    assert BY_MAIN in names
    wrong = ("lindy_research", "research")
    assert [(n, str(f)) for n, f in names if n.partition(".")[0] in wrong] == []


# An option stays where a shipped file sets it, a page explains it, or a test shows that somebody
# needs it. The others are named constants.


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


# The table of events is the only place that names them and words them.


TABLE = "messages/events.py"
KINDS = {row.kind for row in events.ALL.values()}
SHORTEST = 20  # characters of a sentence that cannot stand elsewhere by chance
# A name as a literal: "frozen:sensor/pressure" or f"frozen:{key}"; no sentence with a colon.
NAMED = re.compile(r'(f?)"(\w+):([^"\s]*)"')
# Calls whose argument is an event, or by which one is counted, with a text in its place.
HANDED = re.compile(r'\.(?:tell|count|note|_note|_count)\(\s*(f?)"([^"]*)"')
READ = re.compile(r"\bevents\.([A-Z_]+)")
IMPORTED = re.compile(r"from messages\.events import (\([^)]*\)|.*)")
FOR_USERS = {"ALARM"}  # kinds of which a user's own service tells
# Rows with words of their own that are told through their kind, by who knows the subject alone.
THROUGH_THEIR_KIND = {
    *("CLAMPED_DEPTH", "CLAMPED_HEADING", "CLAMPED_PLACE", "FROZEN_PRESSURE", "HUNG_RECORDER"),
    *("STALE_COMMAND", "STALE_THRUSTERS", "UNHELD_DEPTH", "UNHELD_HEADING"),
}


@cache
def texts() -> dict[str, str]:
    """Every module, without docstrings and comments, with texts of several lines in one."""
    found: dict[str, str] = {}
    for room in ("services", "messages", "tools"):
        for path in sorted((ROOT / room).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            text = path.read_text(encoding="utf-8")
            text = re.sub(r'"\n\s*f?"', "", re.sub(r'"""[\s\S]*?"""|#.*', "", text))
            found[name] = text
    return found


def test_no_event_is_named_by_a_literal_and_no_text_is_told_in_its_place() -> None:
    names = {*KINDS, *events.ALL}
    found = [
        f"{path}: {match[0]}"
        for path, text in texts().items()
        for match in NAMED.finditer(text)
        if path != TABLE and match[2] in KINDS and (match[3] or match[1])
    ]
    found += [
        f"{path}: {match[0]}"
        for path, text in texts().items()
        for match in HANDED.finditer(text)
        if path != TABLE and (match[1] or match[2] in names)
    ]
    assert found == []


def test_every_row_is_told_or_read_by_somebody() -> None:
    kinds = events.Row, events.Condition
    rows = {name: value for name, value in vars(events).items() if isinstance(value, kinds)}
    used = {name for text in texts().values() for name in READ.findall(text)}
    used |= {
        name
        for text in texts().values()
        for imported in IMPORTED.findall(text)
        for name in re.findall(r"\w+", imported)
    }
    assert set(rows) - used == THROUGH_THEIR_KIND | FOR_USERS
    assert all(events.ALL[rows[name].name].kind in events.ALL for name in THROUGH_THEIR_KIND)


def test_no_sentence_stands_twice() -> None:
    sentences = [row.sentence for row in events.ALL.values() if len(row.sentence) >= SHORTEST]
    found = [(path, one) for path, text in texts().items() for one in sentences if one in text]
    assert {path for path, _ in found} == {TABLE}
    assert max(texts()[TABLE].count(f'"{one}"') for one in sentences) == 1
