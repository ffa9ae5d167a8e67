"""The end of a dive in a few lines a pilot cares about."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from math import degrees
from pathlib import Path

from tools.report.report import Report
from tools.report.stops import Axis, Stop

LABEL = 18  # columns before the values
KINDS = 4  # lines for losses; the rest is in report.json
ROUTINE = {
    "accelerating",
    "resting",
}  # counted, and part of any good dive: not worth a pilot's line
# First word of a count → what happened that many times. Others are shown as they are.
PLAIN = {
    "lost": "a message never arrived",
    "dropped": "a message was dropped on a full link",
    "expired": "a command came too late to be used",
    "reordered": "a message came out of order and was left out",
    "duplicated": "a message came twice",
    "malformed": "a message could not be read",
    "wrong_type": "a message was of the wrong type",
    "unknown": "a message came on a key nobody knows",
    "from_future": "a message claimed to come from the future",
    "overflowed": "a message came faster than it could be handled",
    "skipped": "a message was passed over for a newer one",
    "stale": "a stream fell silent for too long",
    "silent": "a step was made without news",
    "clamped": "a value was held at its limit",
    "saturated": "a thruster reached its limit",
    "implausible": "a measurement that cannot be true was left out",
    "outlier": "a measurement far from all others was left out",
    "predicted": "the drone's state was guessed because its IMU was silent",
    "gap": "there was a gap in the measurements",
    "invalid": "control had to do without an estimate",
    "frozen": "a sensor kept saying the same",
    "disturbed": "the compass was disturbed and left out",
    "rate": "a sensor came at the wrong rate",
    "not_newer": "a sample was not newer than the one before",
    "unanswered": "a request was not answered",
    "refused": "a wish of the pilot's was refused",
    "failsafe": "the drone stopped by itself",
    "wrong_epoch": "a command came from somebody who has not got the sticks",
    "unsynchronised": "a message came before the clocks were compared",
    "distrusted": "a thruster did not do what it was told",
    "lost_axis": "an axis could not be driven any more",
    "undriven": "a motion was asked for that the thrusters cannot make",
    "thinned": "a message was left out because the link is narrow",
    "queue_full": "a message found the link's queue full",
    "codel": "a message had waited too long for the link",
    "too_many": "a message was one too many on the way",
    "loss": "the link lost a message",
    "burst": "the link lost a message in a burst",
    "trace": "the link lost a message, as it was measured",
    "outage": "a message found no link",
    "damaged": "the link damaged a message",
    "alarm": "the link got worse",
    "no_bottom": "the Doppler log did not reach the bottom",
    "late": "depth was held by a late estimate, with gentle gains",
    "too_old": "a measurement came too late to be used",
    "clipped": "a measurement was off to one side for too long",
    "jumped": "a clock was set",
    "limited": "the compass deviates by more than can be corrected",
    "outdone": "another pilot took the sticks",
    "missed_deadline": "a step was skipped on a busy computer",
    "not_recorded": "a message was not recorded",
    "disk_error": "the disk could not be written",
    "unreadable": "a recorded message could not be read back",
}


def summary(report: Report, max_depth_m: float | None = None, files: Sequence[Path] = ()) -> str:
    """At most 15 lines.

    Args:
        max_depth_m: as `Dive.max_depth_m` knows it; left out when None.
        files: what was written.
    """
    stick = report.latency_ms.stick_to_thruster
    rows = [("Dive", f"{report.vehicle}, {_duration(report.seconds)}, {ending(report.exit)}")]
    if max_depth_m is not None:
        rows.append(("deepest", f"{max_depth_m:.1f} m"))
    rows += [*_stops(report, "heave"), *_stops(report, "yaw")]
    if stick.p50 is not None and stick.p99 is not None:
        delay = f"{stick.p50:.0f} ms, in 99 of 100 cases below {stick.p99:.0f} ms"
        rows.append(("stick to thruster", delay))
    rows.append(("link", report.link))
    rows.append(("energy", _energy(report)))
    rows += _losses(report.losses)
    return lined_up([*rows, *written(files)])


def lined_up(rows: Iterable[tuple[str, str]]) -> str:
    """Label and text, one pair a line."""
    return "\n".join(f"{label:<{LABEL}}{text}".rstrip() for label, text in rows)


def written(files: Sequence[Path]) -> list[tuple[str, str]]:
    """The row that names the files, which are in one folder; none without files."""
    if not files:
        return []
    return [("written", f"{', '.join(path.name for path in files)} in {files[0].parent}")]


def _energy(report: Report) -> str:
    text = f"{report.energy.wh:.2f} Wh"
    hours = report.energy.endurance_h
    return text if hours is None else f"{text}; a full battery lasts {hours:.1f} h like this"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def ending(exit_reason: str) -> str:
    """`clean`, or why not, in words."""
    return "ended cleanly" if exit_reason == "clean" else f"broke off: {exit_reason}"


def _stops(report: Report, axis: Axis) -> list[tuple[str, str]]:
    """The worst stop of an axis."""
    stops = [stop for stop in report.stops if stop.axis == axis]
    if not stops:
        return []
    worst = max(stops, key=lambda stop: stop.overshoot)
    label = "depth stops" if axis == "heave" else "turn stops"
    return [(label, f"{len(stops)}, worst ran {_past(worst)} too far, at {worst.t:.1f} s")]


def _past(stop: Stop) -> str:
    if stop.axis == "heave":
        return f"{stop.overshoot * 100:.1f} cm"
    return f"{degrees(stop.overshoot):.1f}°"


def _losses(losses: dict[str, int]) -> list[tuple[str, str]]:
    """Counts grouped by what happened, largest first."""
    kinds: defaultdict[str, int] = defaultdict(int)
    for name, count in losses.items():
        kind = name.partition(":")[0]
        if kind not in ROUTINE:
            kinds[kind] += count
    ordered = sorted(((n, kind) for kind, n in kinds.items() if n), reverse=True)
    if not ordered:
        return [("losses", "none")]
    rows = [f"{count} × {PLAIN.get(kind, kind)}" for count, kind in ordered[:KINDS]]
    if len(ordered) > KINDS:
        rows.append(f"and {len(ordered) - KINDS} other kinds, see report.json")
    return [("losses" if n == 0 else "", row) for n, row in enumerate(rows)]
