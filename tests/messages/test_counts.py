"""Every count of every service has words, and those who show counts get them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from messages.counts import KINDS, NAMES, Rank, in_words, known, meaning, sentence

SERVICES = Path(__file__).parents[2] / "services"
NAME = re.compile(r"[a-z_]+:[a-z_./]+")
KIND = re.compile(r"([a-z_]+):")
# Where the first word is a variable: the words that it can be.
GATE = {
    "wrong_type", "malformed", "wrong_epoch", "unsynchronised", "from_future", "expired",
    "duplicated", "reordered",
}  # fmt: skip
ACTUATOR_GATE = {
    "malformed", "wrong_length", "from_future", "expired", "reordered", "wrong_epoch",
}  # fmt: skip
LINE = {"outage", "too_many", "trace", "loss", "burst", "queue_full", "codel"}
VARIABLE = {
    "runtime/node/gate.py": GATE,
    "tether/crossing.py": LINE,
    "vehicle/actuator_gate.py": ACTUATOR_GATE,
    "visualizer/service.py": {"too_old", "wrong_length"},
    "estimation/checks/sensor_watch.py": {"duplicated", "not_newer"},
}


def names_in(tree: ast.AST) -> Iterator[str]:
    """Counts by name, and those made of a kind and a variable as the kind alone."""
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str(text)) if NAME.fullmatch(text):
                yield text
            case ast.JoinedStr(values=[ast.Constant(value=str(text)), *_]):
                if found := KIND.fullmatch(text):
                    yield found[1]
            case ast.Call(func=ast.Attribute(attr="count"), args=[ast.Constant(value=str(text))]):
                yield text
            case _:
                pass


def used() -> dict[str, str]:
    """Name or kind → the file that counts it."""
    found: dict[str, str] = {}
    for path in sorted(SERVICES.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found |= dict.fromkeys(names_in(tree), str(path.relative_to(SERVICES)))
    for file, kinds in VARIABLE.items():
        found |= dict.fromkeys(kinds, file)
    found["missed_deadline"] = "runtime/node/timers.py"
    return found


@pytest.mark.parametrize("name", sorted(used()))
def test_every_count_of_a_service_has_words(name: str):
    assert known(name), f"{used()[name]} counts {name!r}: give it words in messages/counts.py"


def test_all_the_counts_are_looked_at():
    found = used()
    assert len(found) > 60
    assert {"failsafe", "saturated", "thinned", "not_recorded", "alarm:link", "gap:sensor/imu"} <= {
        *found
    }


def test_counts_whose_first_word_is_a_variable_are_all_listed():
    """`f"{reason}:{key}"` stands in these files and in no other."""
    there = {
        str(path.relative_to(SERVICES))
        for path in SERVICES.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.JoinedStr)
        and len(node.values) == 3
        and isinstance(node.values[0], ast.FormattedValue)
        and isinstance(node.values[1], ast.Constant)
        and node.values[1].value == ":"
    }
    assert there == {*VARIABLE}


@pytest.mark.parametrize(
    ("kinds", "files"),
    [
        (GATE, ["runtime/node/gate.py"]),
        (ACTUATOR_GATE, ["vehicle/actuator_gate.py"]),
        (LINE, ["tether/link_model.py", "tether/priority_queue.py", "tether/loss.py"]),
    ],
)
def test_the_listed_words_are_those_in_the_code(kinds: set[str], files: list[str]):
    text = "".join((SERVICES / file).read_text(encoding="utf-8") for file in files)
    assert all(f'"{kind}"' in text for kind in kinds)


def test_words_are_words_and_no_two_kinds_share_a_name():
    for words in (entry.words for entry in (*NAMES.values(), *KINDS.values())):
        assert re.search("[a-z] [a-z]", words)
        assert not re.search("[_{}]", words)


def test_every_alarm_speaks_for_itself():
    assert sentence("alarm:link") == "the link got worse"
    assert "link" not in sentence("alarm:leak")
    assert "leak" in sentence("alarm:leak")
    assert meaning("alarm:leak").rank is Rank.DANGER


def test_a_failsafe_is_more_important_than_anything_else():
    ranks = {name: meaning(name).rank for name in (*NAMES, *KINDS)}
    assert {name for name, rank in ranks.items() if rank is Rank.FAILSAFE} == {
        name for name in ranks if name.partition(":")[0] == "failsafe"
    }


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("failsafe:pilot_lost", "pilot lost: the drone came to rest and held"),
        ("saturated:vertical", "a thruster reached its limit (vertical)"),
        ("odd:thing", "odd:thing"),
        ("link: clamped", "link: clamped"),
        ("armed: script first_dive has the sticks", "armed: script first_dive has the sticks"),
    ],
)
def test_log_lines_that_are_names_are_shown_as_sentences(text: str, shown: str):
    assert in_words(text) == shown
