"""`lindy log compare`: two recordings side by side."""

from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import Parameter

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import Json, NewPicture
from tools.fresh import write_fresh
from tools.log.compare_picture import check_picture, drawn
from tools.log.differences import Differences, FieldDifference, differences, zeros
from tools.log.figures import ComparedFigure, figures
from tools.log.series import DiveSeries, Words
from tools.log.text_table import table
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

SAME, DIFFERENT, INCOMPLETE = 0, 1, 3  # exit statuses
SHOWN = 20  # fields on the screen; all of them are in the JSON


def compare(
    a: Path,
    b: Path,
    *,
    tolerance: Annotated[
        float, Parameter(help="[-] of the largest value of a field: what counts as the same")
    ] = 0.0,
    out: NewPicture = None,
    json: Json = False,
) -> int:
    """What differs between two recordings, when first.

    And by how much, by stream and field. A and B are dives' folders or MCAP files, of one vehicle.
    Times are seconds since arming, or, where one was never armed, since the recording began. Exit
    status 1: they differ; 3: one is damaged or was not finished.

    Example: lindy log compare dives/before dives/after --out compared.png
    """
    if not tolerance >= 0.0:
        raise LindyError(f"--tolerance is {tolerance:g}, expected 0 or more")
    if out is not None:
        check_picture(out)
    left, right = open_recording(a), open_recording(b)
    _require_one_vehicle(left, right)
    with reading("comparing", left.size + right.size) as advance:
        words = Words()
        left.advance = advance
        series_a = DiveSeries(left, words)
        right.advance = lambda at: advance(left.size + at)
        series_b = DiveSeries(right, words)
    for path, recording, series in ((a, left, series_a), (b, right, series_b)):
        if not series.topics:
            raise recording.empty(path)
    damage = [
        f"{path}: {said}"
        for path, recording, series in ((a, left, series_a), (b, right, series_b))
        for said in [*recording.damage, *series.unreadable]
    ]
    found, side_by_side = differences(series_a, series_b, tolerance), figures(left, right)
    if out is not None:
        write_fresh(out, drawn(series_a, series_b, (str(a), str(b))))
    if json:
        whole = {
            "same": found.none,
            "zero": "arming" if zeros(series_a, series_b)[0] == series_a.armed_ns else "beginning",
            "damage": damage,
            "figures": msgspec.to_builtins(side_by_side),
            **msgspec.to_builtins(found),
        }
        print(msgspec.json.format(msgspec.json.encode(whole)).decode())
    else:
        print(harmless(as_text(found, side_by_side)))
        if out is not None:
            print(f"written {out}")
        print(harmless("".join(f"{said}\n" for said in damage)), end="")
    if damage:
        return INCOMPLETE
    return SAME if found.none else DIFFERENT


def _require_one_vehicle(a: Recording, b: Recording) -> None:
    names = [recording.metadata("dive").get("vehicle", "") for recording in (a, b)]
    if names[0] != names[1]:
        raise LindyError(
            f"{a.files[0]} is of the vehicle {names[0] or 'unknown'}, {b.files[0]} of "
            f"{names[1] or 'unknown'}: compare two dives of one vehicle"
        )


def as_text(found: Differences, side_by_side: list[ComparedFigure]) -> str:
    """Figures, topics with other numbers of messages, then the fields that differ."""
    blocks = [_figures(side_by_side)]
    if found.none:
        same = "all fields of all messages are the same; their stamps and numbers are not compared"
        return f"{blocks[0]}\n\n{same}"
    if found.counts:
        rows = [[each.topic, str(each.a), str(each.b)] for each in found.counts]
        blocks.append(table(["messages of", "A", "B"], rows))
    if found.fields:
        heads = ["topic", "field", "first [s]", "A", "B", "largest", "at [s]"]
        blocks.append(table(heads, [_row(field) for field in found.fields[:SHOWN]], left=2))
        more = len(found.fields) - SHOWN
        if more > 0:
            blocks[-1] += f"\nand {more} more fields; --json has all"
    return "\n\n".join(blocks)


def _figures(side_by_side: list[ComparedFigure]) -> str:
    rows = [
        [
            each.name,
            each.unit,
            _number(each.a),
            _number(each.b),
            "" if each.a is None or each.b is None else _number(each.b - each.a),
        ]
        for each in side_by_side
    ]
    return table(["", "", "A", "B", "B - A"], rows, left=2)


def _row(field: FieldDifference) -> list[str]:
    values = [value if isinstance(value, str) else _number(value) for value in (field.a, field.b)]
    largest, at = _number(field.largest), _number(field.largest_s)
    return [
        field.topic,
        field.field,
        f"{field.first_s:.3f}",
        *(v[:24] for v in values),
        largest,
        at,
    ]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
