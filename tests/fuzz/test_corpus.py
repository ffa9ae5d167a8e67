"""Every input of the corpus obeys the law of what reads it, and the search finds what does not."""

import re
from math import inf
from pathlib import Path

import pytest

from tests.fuzz.targets import CORPUS, MOST_S, TARGETS, Target, TooMuch, obey
from tests.long.fuzz import Searched

LARGEST = 200_000  # [bytes] of all of it


@pytest.mark.parametrize("name", TARGETS)
def test_every_input_is_taken_or_refused(name: str) -> None:
    for data in TARGETS[name].corpus().values():
        obey(TARGETS[name], data)


def test_every_input_has_its_reason_and_all_are_small() -> None:
    files = [path for path in CORPUS.rglob("*") if path.is_file()]
    told = re.findall(r"^\| `(.*?)` \| .+ \|$", (CORPUS / "README.md").read_text(), re.MULTILINE)
    there = {str(path.relative_to(CORPUS)) for path in files} - {"README.md"}
    assert sorted(told) == sorted(there)
    assert {Path(name).parts[0] for name in there} <= {each.folder for each in TARGETS.values()}
    assert sum(path.stat().st_size for path in files) < LARGEST


def test_what_breaks_the_law_is_found_and_made_small() -> None:
    def broken(data: bytes, _: Path) -> None:
        if b"router" in data and b"ann" not in data:
            raise RecursionError

    found = Searched(Target("admitted", broken)).find(inf)
    assert found is not None
    assert found[0] == b"router"
    assert isinstance(found[1], RecursionError)


@pytest.mark.slow
def test_what_never_ends_is_ended() -> None:
    def endless(_data: bytes, _: Path) -> None:
        while True:
            pass

    with pytest.raises(TooMuch, match=f"more than {MOST_S:g} s"):
        obey(Target("admitted", endless), b"")
