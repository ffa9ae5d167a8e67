"""One name, one range: the bounded numbers of messages and settings."""

import re
from collections import defaultdict
from pathlib import Path

import msgspec
import pytest

from messages import units

ROOT = Path(__file__).parents[2]


NUMBER = re.compile(r"^(\w+) = Annotated\[|^(Vec3|Vec6|Quaternion) = ", re.MULTILINE)


def number_types() -> dict[str, list[str]]:
    """Every name that is given to a bounded number or to a vector, and the files that do so."""
    found: dict[str, list[str]] = defaultdict(list)
    for folder in ("messages", "services", "tools"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            for match in NUMBER.finditer(file.read_text(encoding="utf-8")):
                found[match[1] or match[2]].append(str(file.relative_to(ROOT)))
    return found


def test_no_two_number_types_share_a_name() -> None:
    found = number_types()
    assert found["Positive"] == found["Vec3"] == ["messages/units.py"]
    assert {name: files for name, files in found.items() if len(files) > 1} == {}


@pytest.mark.parametrize(
    ("kind", "least", "below"),
    [
        (units.Positive, 1e-300, 0.0),
        (units.NotNegative, 0.0, -1e-300),
        (units.NotNegativeSetting, 0.0, -1e-300),
        (units.Share, 0.0, -1e-300),
        (units.OpenShare, 1e-300, 0.0),
    ],
)
def test_a_name_says_whether_nothing_is_allowed(kind: object, least: float, below: float) -> None:
    assert msgspec.convert(least, kind) == least
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(below, kind)
