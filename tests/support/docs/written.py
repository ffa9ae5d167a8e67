"""The pages of docs/ that are written from the code: `make docs`. Failsafes come from the table
itself, streams and the keys of report.json from their Structs."""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec

from messages import topics
from messages.link import DirectionReport, Stage
from messages.message import Estimate, Notice
from messages.pilot import Course, StopDistance
from messages.reference import Motion
from messages.topic import AnyTopic
from messages.vehicle import PlaceAhead, Reaction
from services.reference.failsafe.table import SHORT_NS, FailsafeRow, FailsafeStage, table
from services.reference.settings import FailsafeSettings
from tests.support.faults import page as faults_page
from tools.report.report import Report

# Failsafes.


FAILSAFES = """# Failsafes

What the drone watches, what it does by itself, and what ends that. The drone acts on board, so it
needs no link. `make docs` writes this page from `services/reference/failsafe/table.py`. Times and
thresholds are the defaults of the table `[reference.failsafe]` of a vehicle file.

- **notice**: the pilot reads it. Nothing else happens.
- **limit**: the drone comes to rest at the limit and goes no further; `goto` and `follow` beyond
  the depth limit are refused.
- **stop**: it comes to rest smoothly, and holds depth, heading and, where it was held, position.
- **ascend**: it rises at `ascent_speed` to `surface_depth`, and stays there (**surface**). It
  waits while there is no state, and does not go down where it is higher already.

Of several conditions the gravest reaction acts. Notice and limit end with their condition. The
others end by `resume` (the arm button of the pad, Enter on the keyboard, `lindy ask resume`) or
`disarm`; until then the sticks do nothing. `resume` is refused while the condition holds, except
where the table says "at any time": the condition then acts again only when it has ended or become
worse. A loss of state, link or pilot of less than 2 s ends by itself once the same pilot's sticks
were centred for 0.3 s. A script resumes by itself.

STOP of a pilot is no failsafe: it brakes, holds and stays armed, and the sticks act again once
they were centred.

| condition | the pilot reads | when | what the drone does | ended by | what to do |
|---|---|---|---|---|---|
"""


def failsafes_page() -> str:
    """The whole page."""
    return FAILSAFES + "".join(f"{_line(row)}\n" for row in table(FailsafeSettings()))


def _line(row: FailsafeRow) -> str:
    stages = ", then ".join(map(_stage, row.stages))
    c = row.condition
    cells = (f"`{c.name}`", c.sentence, row.measured, stages, _ends_by(row), c.noticed.to_do)
    return f"| {' | '.join(cells)} |".replace("|  |", "| |")


def _ends_by(row: FailsafeRow) -> str:
    if not row.acts:
        return "itself"
    if row.overrule:
        return "resume, at any time"
    ended = "once it has ended"
    short = f"centred sticks after less than {SHORT_NS / 1e9:g} s, else "
    return f"{short}resume, {ended}" if row.brief else f"resume, {ended}"


def _stage(stage: FailsafeStage) -> str:
    last: dict[Reaction, str] = {"ascend": "ascend and stay at the surface"}
    does = last.get(stage.reaction, stage.reaction)
    return does if stage.after == 0.0 else f"after {stage.after:g} s {does}"


# Streams.


TOPICS = """# Topics

Every stream in the system. Written by `make docs` from `messages/`; do not edit.

Keys are relative to the namespace `lindy/@v1/<drone's name>`. Every message is a msgpack map with
`seq` (count per publisher) and `stamp_ns` (when the content was true). A request also has an `id`;
its answer has the same `id` and says whether it was `accepted`. A topic is stale after
five periods, and never before 100 ms.

Streams with a weight are thinned out where the link has no room for all: a picture has 1,900 kbit/s
first, and what is left is divided by weight, with no less than the floor for each. Where not even
the floors fit, the lightest streams yield first, down to a tenth of their floor.
"""


def topics_page() -> str:
    """The whole page."""
    rows = [
        "| key | message | Hz | how it travels | across; weight, floor [1/s] |",
        "|---|---|---|---|---|",
        *map(_stream, topics.ALL),
    ]
    kinds: list[type[msgspec.Struct]] = list(dict.fromkeys(t.message for t in topics.ALL))
    kinds += [
        Estimate,
        Motion,
        DirectionReport,
        Stage,
        Course,
        StopDistance,
        PlaceAhead,
        Notice,
    ]  # parts of messages
    return "\n".join([TOPICS, *rows, "", *map(section, kinds)])


def _stream(topic: AnyTopic) -> str:
    name = topic.message.__name__
    rate = f"{topic.hz:g}" if topic.hz else "event"
    where = f"[{name}](#{name.lower()})"
    thinned = f"; {topic.weight:g}, {topic.floor_hz:g}" if topic.weight else ""
    across = f"{topic.way.value}{thinned}"
    return f"| `{topic.key}` | {where} | {rate} | {topic.qos.value} | {across} |"


def section(kind: type[msgspec.Struct]) -> str:
    """A message: its docstring and its fields with the comment on their line."""
    about = inspect.cleandoc(kind.__dict__.get("__doc__") or "").replace("\n", " ")
    fields = [
        f"- `{match[1]}`" + (f" {match[2].strip()}" if match[2] else "")
        for line in inspect.getsource(kind).splitlines()
        if (match := re.match(r"    (\w+): [^#]*(?:#(.*))?$", line))
    ]
    return "\n".join([f"## {kind.__name__}", *([about, ""] if about else [""]), *fields, ""])


# The keys of report.json.


REPORT = """# Keys of report.json

Every dive writes a `report.json`. Written by `make docs` from `tools/report/`; do not edit.

The keys stay, so that programs can rely on them. `null` is what could not be measured on this dive;
a key that is left out belongs to what this dive did not have, such as a camera. In Python:
`json.load(open("dives/latest/report.json"))["stops"]`.
"""


def report_page() -> str:
    """The whole page."""
    return "\n".join([REPORT, *map(section, dict.fromkeys(parts(Report)))])


def parts(kind: Any) -> Iterator[type[msgspec.Struct]]:
    """The Structs of a type, and of all fields of each, from the outside in."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind
        for inner in get_type_hints(kind).values():
            yield from parts(inner)
    for inner in get_args(kind):
        yield from parts(inner)


FOLDER = Path(__file__).parents[3] / "docs"
PAGES = {
    "failsafes": failsafes_page,
    "report": report_page,
    "topics": topics_page,
    "faults": faults_page.page,
}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (FOLDER / f"{name}.md").write_text(page(), encoding="utf-8")
