"""`docs/report.md`, the keys of `report.json`, written from its Structs (`make docs`)."""

from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

import msgspec

from tests.support.docs.topics_page import section
from tools.report.report import Report

HEADING = """# Keys of report.json

Every dive writes a `report.json`. Written by `make docs` from `tools/report/`; do not edit.

The keys stay, so that programs can rely on them. `null` is what could not be measured on this dive;
a key that is left out belongs to what this dive did not have, such as a camera. In Python:
`json.load(open("dives/latest/report.json"))["stops"]`.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([HEADING, *map(section, dict.fromkeys(parts(Report)))])


def parts(kind: Any) -> Iterator[type[msgspec.Struct]]:
    """The Structs of a type, and of all fields of each, from the outside in."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind
        for inner in get_type_hints(kind).values():
            yield from parts(inner)
    for inner in get_args(kind):
        yield from parts(inner)
