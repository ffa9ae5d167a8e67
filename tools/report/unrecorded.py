"""Summary of a dive on the machine without a report, whose recorder heard only what crossed the
link: but only its own supervisor knows its restarts."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from tools.report.elsewhere import in_a_row
from tools.report.restarted import restarted
from tools.report.summary import lined_up, written


def unrecorded(
    how: str,
    restarts: Mapping[str, int],
    gone: Sequence[str],
    other: str,
    files: Sequence[Path],
    shared: Mapping[str, str] | None = None,
) -> str:
    """At most six lines.

    Args:
        how: the side, the vehicle and how the dive ended.
        restarts: times each service and hub here was started again.
        gone: services that were not alive at the end.
        other: the side that has the report.
        files: files that were written here, such as the viewer's.
        shared: the process of each service that is not alone in a process of its own name.
    """
    again = restarted(restarts, shared or {})
    rows = [
        ("Dive", how),
        ("restarted", in_a_row(again) or "nothing"),
        ("lost", f"{in_a_row(gone)} not alive at the end" if gone else "no service"),
        ("recorded", _recorded(files, other)),
    ]
    return lined_up([*rows, *written(files)])


def _recorded(files: Sequence[Path], other: str) -> str:
    if any(path.suffix == ".mcap" for path in files):
        return f"what was heard here; all that never crosses, and report.json, are on the {other}"
    return f"nothing here: recording and report.json are on the {other}"
