"""A class name stands for one thing in the whole project."""

import re
from collections import Counter
from functools import cache
from pathlib import Path

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
