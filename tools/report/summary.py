"""The summary of a dive: the few lines that matter to a pilot, also on the machine of two that has
no report."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from math import degrees
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages import cameras, events
from messages.events import FAILSAFE, ROUTINE, Severity, row_of
from messages.vehicle import Reaction
from services.marine.summation import plain_sum
from tools.analysis.stops import StopAxis
from tools.report.report import Hole, Report, by_process, ending

LABEL = 18  # columns before the values
DISK = "the disk was full or failed"
DID: dict[Reaction, str] = {
    "stop": "came to rest and held",
    "ascend": "rose",
    "surface": "stayed at the surface",
}  # by itself
AT_ONCE_S = 0.5  # [s] a condition that acts sooner is not said to have been noticed before
KINDS = 4  # lines for losses; the rest is in report.json
HOLES = 2  # in words; all are in report.json


def summary(
    report: Report,
    max_depth_m: float | None = None,
    files: Sequence[Path] = (),
    *,
    all_losses: bool = False,
) -> str:
    """At most 15 lines, one more for each kind of failsafe, one for each process that was started
    again, and one where the disk was full.

    Args:
        max_depth_m: as `RecordedDive.max_depth_m`; left out when None.
        files: what was written.
        all_losses: every kind of loss, also beyond those lines: there is no report.json.
    """
    stick = report.latency_ms.stick_to_thruster
    how = ending(report.exit, report.troubles)
    own = "" if report.drone == report.vehicle else f" ({report.vehicle})"
    rows = [("Dive", f"{report.drone}{own}, {_length(report)}, {how}")]
    if _cut(report):
        missing = plain_sum(hole.end - hole.begin for hole in report.holes)
        recorded = _duration(report.seconds - missing)
        rows.append(("incomplete", f"{DISK}; all figures are of the recorded {recorded}"))
    rows += _failsafes(report)
    if max_depth_m is not None:
        rows.append(("deepest", f"{max_depth_m:.1f} m"))
    rows += [*_stops(report, "heave"), *_stops(report, "yaw")]
    if stick.p50 is not None and stick.p99 is not None:
        delay = f"{stick.p50:.0f} ms, in 99 of 100 cases below {stick.p99:.0f} ms"
        rows.append(("stick to thruster", delay))
    rows += _pictures(report)
    rows.append(("link", "; ".join([report.link, *_lost(report.budget_ms.lost_s)])))
    hours = report.energy.endurance_h
    lasts = "" if hours is None else f"; a full battery lasts {hours:.1f} h like this"
    rows.append(("energy", f"{report.energy.wh:.2f} Wh{lasts}"))
    restarts = {name: service.restarts for name, service in report.services.items()}
    shared = {name: s.process for name, s in report.services.items() if s.process is not None}
    rows += _labelled("restarted", restarted(restarts, shared))
    rows += _losses(report, None if all_losses else KINDS)
    return lined_up([*rows, *written(files)])


def lined_up(rows: Iterable[tuple[str, str]]) -> str:
    """Label and text, one pair a line."""
    return "\n".join(f"{label:<{LABEL}}{text}".rstrip() for label, text in rows)


def written(files: Sequence[Path]) -> list[tuple[str, str]]:
    """The row that names the files, which are in one folder; none without files."""
    if not files:
        return []
    return [("written", f"{', '.join(path.name for path in files)} in {files[0].parent}")]


def _lost(seconds: float | None) -> list[str]:
    """What a person lacked because of the link."""
    return [f"the pilot saw nothing of the drone for {seconds:.1f} s"] if seconds else []


def _pictures(report: Report) -> list[tuple[str, str]]:
    """A row for each camera of which a picture was decoded."""
    more = {} if report.further_pictures is msgspec.UNSET else report.further_pictures
    first = {} if report.picture is msgspec.UNSET else {cameras.FIRST: report.picture}
    rows = list[tuple[str, str]]()
    for name, seen in {**first, **more}.items():
        if seen.p50_ms is not None:
            age = f"{seen.p50_ms:.0f} ms, in 99 of 100 cases below {seen.p99_ms:.0f} ms"
            text = f"{age}; {seen.per_second:.1f} a second"
            rows.append(("light to picture", f"{name}: {text}" if more else text))
    return rows


def _labelled(label: str, rows: Sequence[str]) -> list[tuple[str, str]]:
    """With the label before the first."""
    return [(label if n == 0 else "", row) for n, row in enumerate(rows)]


def _length(report: Report) -> str:
    """Of the recording, and how much of it the drone was armed."""
    whole, armed = _duration(report.seconds), _duration(report.armed_seconds)
    if _cut(report):
        whole, armed = f"recorded {whole}", f"{armed} of them"
    return f"{whole}, armed {armed}" if report.armed_seconds > 0.0 else whole


def _cut(report: Report) -> bool:
    """May the dive have been longer than its recording?"""
    return report.losses.get(events.DISK_ERROR.name, 0) > 0


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def _failsafes(report: Report) -> list[tuple[str, str]]:
    """One row for each kind; none is left out."""
    acted = sorted(
        ((n, name) for name, n in report.losses.items() if n and row_of(name).severity is FAILSAFE),
        reverse=True,
    )
    return [("failsafe", f"{count} × {_acted(report, name)}") for count, name in acted]


def _acted(report: Report, name: str) -> str:
    """What the drone did: when it was noticed, if it acted later, when it acted first, and how long
    in all; nothing of that where no status says so."""
    condition, words = name.partition(":")[2], events.sentence(name)
    reactions = [r for r in report.failsafes if r.condition == condition]
    if not reactions:
        return words
    first, seconds = reactions[0], sum(reaction.seconds for reaction in reactions)
    did = dict.fromkeys(DID[r.reaction] for r in reactions if r.reaction in DID)
    words += f"; the drone {', then '.join(did)}"
    if first.noticed is not None and first.t - first.noticed > AT_ONCE_S:
        words += f", noticed at {first.noticed:.1f} s"
    return f"{words}, first at {first.t:.1f} s, {seconds:.1f} s in all"


def _stops(report: Report, axis: StopAxis) -> list[tuple[str, str]]:
    """The worst stop of an axis."""
    stops = [stop for stop in report.stops if stop.axis == axis]
    if not stops:
        return []
    worst = max(stops, key=lambda stop: stop.overshoot)
    label, past = "depth stops", f"{worst.overshoot * 100:.1f} cm"
    if axis == "yaw":
        label, past = "turn stops", f"{degrees(worst.overshoot):.1f}°"
    by = ", by its own estimate" if worst.by else ""
    return [(label, f"{len(stops)}, worst ran {past} too far, at {worst.t:.1f} s{by}")]


def is_loss(name: str) -> bool:
    """Is this count one of something lost? Failsafes are told apart, and routine is no loss."""
    return FAILSAFE < row_of(name).severity < ROUTINE


def _losses(report: Report, kinds: int | None) -> list[tuple[str, str]]:
    """Counts with the same words together; the most important first, in the order of the table:
    water in the enclosure before a service that was late, however often.

    Args:
        kinds: rows at most, and one that says how many more there are; None: all.
    """
    times: defaultdict[tuple[Severity, int, str], int] = defaultdict(int)
    places = {row.sentence: place for place, row in enumerate(events.ALL.values())}
    for name, count in report.losses.items():
        if count and is_loss(name):
            row = row_of(name)
            times[row.severity, places.get(row.sentence, len(places)), row.sentence] += count
    ordered = sorted(times.items())
    rows = [_of_holes(report.holes)] if report.holes else []
    if not ordered and not rows:
        return [("events", "none")]
    rows += [f"{count} × {sentence}" for (_, _, sentence), count in ordered[:kinds]]
    if kinds is not None and (more := len(ordered) - kinds) > 0:
        rows.append(f"and {more} more kind{'s' * (more > 1)}, see report.json")
    return _labelled("events", rows)


def _of_holes(found: list[Hole]) -> str:
    """One sentence, the longest first."""
    longest = sorted(found, key=lambda hole: hole.begin - hole.end)
    text = " and ".join(f"from {hole.begin:.1f} to {hole.end:.1f} s" for hole in longest[:HOLES])
    more = len(found) - HOLES
    return f"nothing was recorded {text}" + (f", and {more} more times" if more > 0 else "")


def restarted(restarts: Mapping[str, int], shared: Mapping[str, str]) -> list[str]:
    """`control 1 ×`, or of services in one process `onboard (estimation, reference) 1 ×`.

    Args:
        restarts: times each service and hub was started again; a process takes all its services.
        shared: the process of each service that is not alone in a process of its own name.
    """
    parts: dict[str, list[str]] = {}
    for name in sorted(restarts):
        if name in shared:
            parts.setdefault(shared[name], []).append(name)
    inside = {process: f" ({', '.join(names)})" for process, names in parts.items()}
    return [
        f"{process}{inside.get(process, '')} {count} ×"
        for process, count in by_process(restarts, shared).items()
    ]


def unrecorded(
    how: str,
    restarts: Mapping[str, int],
    gone: Sequence[str],
    other: str,
    files: Sequence[Path],
    shared: Mapping[str, str] | None = None,
    lost_s: float = 0.0,
) -> str:
    """Of a dive on the machine without a report, whose recorder heard only what crossed the link:
    but only its own supervisor knows its restarts. At most seven lines.

    Args:
        how: the side, the vehicle and how the dive ended.
        restarts: times each service and hub here was started again.
        gone: services that were not alive at the end.
        other: the side that has the report.
        files: files that were written here, such as the viewer's.
        shared: the process of each service that is not alone in a process of its own name.
        lost_s: [s] in which nothing of the drone arrived.
    """
    again = restarted(restarts, shared or {})
    recorded = f"nothing here: recording and report.json are on the {other}"
    if any(path.suffix == ".mcap" for path in files):
        recorded = f"what arrived here; the whole recording and report.json are on the {other}"
    rows = [
        ("Dive", how),
        *[("link", words) for words in _lost(lost_s)],
        ("restarted", in_a_row(again) or "nothing"),
        ("services", f"not alive at the end: {in_a_row(gone)}" if gone else "all alive at the end"),
        ("recorded", recorded),
    ]
    return lined_up([*rows, *written(files)])


class Elsewhere(NamedTuple):
    """The other machine."""

    side: str  # topside or drone
    services: tuple[str, ...]  # services whose home side it is


def elsewhere(report: Report, other: Elsewhere) -> str:
    """One sentence, as a row of the summary."""
    silent = [name for name in other.services if name not in report.services]
    if len(silent) == len(other.services):
        text = f"the {other.side} was never heard: nothing of it is in this report"
        return lined_up([("elsewhere", text)])
    text = f"only the {other.side} knows its restarts, and its messages that never arrived"
    figures = {  # that come from the topside's messages
        "stick to thruster": report.latency_ms.stick_to_thruster.p50,
        "sensor to screen": report.budget_ms.sensor_to_screen,
        "the clock offset": report.clocks.offset_ms,
    }
    if unknown := [name for name, value in figures.items() if value is None]:
        text += f"; not known here: {in_a_row(unknown)}"
    if silent:
        text += f"; never heard: {in_a_row(silent)}"
    return lined_up([("elsewhere", text)])


def in_a_row(names: Sequence[str]) -> str:
    """a, b and c"""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
