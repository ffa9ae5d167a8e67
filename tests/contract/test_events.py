"""The table of events is the only place that names them and words them."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from messages import events

ROOT = Path(__file__).parents[2]
TABLE = "messages/events.py"
KINDS = {row.kind for row in events.ALL.values()}
SHORTEST = 20  # characters of a sentence that cannot stand elsewhere by chance
# Calls whose argument is an event, or by which one is counted.
WAYS_OUT = {"tell", "count", "note", "_note", "_count"}
FOR_USERS = {"ALARM"}  # kinds of which a user's own service tells
# Rows with words of their own that are told through their kind, by who knows the subject alone.
THROUGH_THEIR_KIND = {
    *("CLAMPED_DEPTH", "CLAMPED_HEADING", "CLAMPED_PLACE", "FROZEN_PRESSURE", "HUNG_RECORDER"),
    *("STALE_COMMAND", "STALE_THRUSTERS", "UNHELD_DEPTH", "UNHELD_HEADING"),
}


@cache
def trees() -> dict[str, ast.Module]:
    paths = [path for room in ("services", "messages", "tools") for path in room_of(room)]
    return {path: ast.parse((ROOT / path).read_text(encoding="utf-8")) for path in paths}


def room_of(room: str) -> Iterator[str]:
    for path in sorted((ROOT / room).rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if name != TABLE:
            yield name


def strings(tree: ast.AST) -> Iterator[tuple[ast.Constant, bool]]:
    """Every text but docstrings, and whether more of an f-string follows it."""
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    begins = {
        id(node.values[0]) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)
        if len(node.values) > 1
    }  # fmt: skip
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in docstrings:
            assert isinstance(node, ast.Constant)
            yield node, id(node) in begins


def names_an_event(text: str, begins: bool) -> bool:
    """`frozen:sensor/pressure`, or the beginning of f"frozen:{key}"; no sentence with a colon."""
    kind, colon, subject = text.partition(":")
    if not colon or kind not in KINDS or " " in subject or (not subject and not begins):
        return False
    return begins or text in events.ALL or subject != ""


@pytest.mark.parametrize(
    ("text", "begins", "is_one"),
    [
        ("frozen:sensor/pressure", False, True),
        ("frozen:", True, True),
        ("leak: bring the drone up", False, False),
        ("failsafe: ", True, False),
        ("script:", True, False),
        ("frozen", False, False),
    ],
)
def test_what_names_an_event(text: str, begins: bool, is_one: bool) -> None:
    assert names_an_event(text, begins) == is_one


@pytest.mark.slow
def test_no_event_is_named_by_a_literal() -> None:
    found = [
        f"{path}:{node.lineno}: {node.value!r}"
        for path, tree in trees().items()
        for node, begins in strings(tree)
        if names_an_event(str(node.value), begins)
    ]
    assert found == []


@pytest.mark.slow
def test_no_text_is_handed_to_an_outbox_as_an_event() -> None:
    names = {*KINDS, *events.ALL}
    found = [
        f"{path}:{node.lineno}"
        for path, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in WAYS_OUT
        and any(
            isinstance(part, ast.JoinedStr)
            or (isinstance(part, ast.Constant) and part.value in names)
            for part in node.args
        )
    ]
    assert found == []


def read_of_the_table(tree: ast.Module) -> Iterator[str]:
    """`events.LEAK`, or imported by its name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id == "events":
                yield node.attr
        elif isinstance(node, ast.ImportFrom) and node.module == "messages.events":
            yield from (alias.name for alias in node.names)


def test_every_row_is_told_or_read_by_somebody() -> None:
    rows = {
        name: value
        for name, value in vars(events).items()
        if isinstance(value, events.Row | events.Condition)
    }
    used = {name for tree in trees().values() for name in read_of_the_table(tree)}
    assert set(rows) - used == THROUGH_THEIR_KIND | FOR_USERS
    assert all(events.ALL[rows[name].name].kind in events.ALL for name in THROUGH_THEIR_KIND)


def test_no_sentence_stands_twice() -> None:
    sentences = {row.sentence for row in events.ALL.values() if len(row.sentence) >= SHORTEST}
    found = [
        f"{path}:{node.lineno}: {node.value!r}"
        for path, tree in trees().items()
        for node, _ in strings(tree)
        if any(sentence in str(node.value) for sentence in sentences)
    ]
    assert found == []
    table = ast.parse((ROOT / TABLE).read_text(encoding="utf-8"))
    own = [str(node.value) for node, _ in strings(table) if str(node.value) in sentences]
    assert len(own) == len(set(own))
