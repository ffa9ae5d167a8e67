"""The table of events is the only place that names them and words them."""

import re
from functools import cache
from pathlib import Path

from messages import events

ROOT = Path(__file__).parents[2]
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
