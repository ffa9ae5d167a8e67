"""`docs/topics.md`, written from the table and the Structs themselves (`make docs`)."""

import inspect
import re

import msgspec

from messages import topics
from messages.link import DirectionReport, Stage
from messages.message import Estimate
from messages.notice import Notice
from messages.pilot import Course, StopDistance
from messages.prediction import Miss
from messages.reference import Motion
from messages.topic import AnyTopic
from messages.vehicle import PlaceAhead

HEADING = """# Topics

Every stream in the system. Written by `make docs` from `messages/`; do not edit.

Keys are relative to the namespace `lindy/@v1/<drone's name>`. Every message is a msgpack map with
`seq` (count per publisher) and `stamp_ns` (when the content was true). A request also has an `id`;
its answer has the same `id` and says whether it was `accepted`. A topic is stale after
five periods, and never before 100 ms.

Streams with a weight are thinned out where the link has no room for all: a picture has 1,900 kbit/s
first, and what is left is divided by weight, with no less than the floor for each. Where not even
the floors fit, the lightest streams yield first, down to a tenth of their floor.
"""


def page() -> str:
    """The whole page."""
    rows = [
        "| key | message | Hz | how it travels | across; weight, floor [1/s] |",
        "|---|---|---|---|---|",
        *map(_row, topics.ALL),
    ]
    kinds: list[type[msgspec.Struct]] = list(dict.fromkeys(t.message for t in topics.ALL))
    kinds += [
        Estimate,
        Motion,
        DirectionReport,
        Stage,
        Miss,
        Course,
        StopDistance,
        PlaceAhead,
        Notice,
    ]  # parts of messages
    return "\n".join([HEADING, *rows, "", *map(section, kinds)])


def _row(topic: AnyTopic) -> str:
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
