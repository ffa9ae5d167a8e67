"""A review in a few sentences, for the owner of the vehicle."""

import re
from collections.abc import Iterator
from math import degrees
from statistics import median

from messages.events import row_of
from tools.analysis.dive import STICKS
from tools.review.estimated import in_words
from tools.review.review import Review
from tools.review.stick_stops import ReviewedStop

ENOUGH_KNOWN = 0.95  # [-] of the time after calibration: less, and it would have stopped under way
# What a section lacks follows from what another one lacks, and is not said again.
FOLLOWS = {"measurements": "estimation"}


def in_short(found: Review) -> list[str]:
    """What the page says, in the order of its sections."""
    return [
        *(*_dive(found), _verdict(found), *_sensors(found), *_vibration(found)),
        *(*_estimation(found), *_stops(found), *_measurements(found)),
        *_missing(found),
    ]


def amount(value: float, unit: str) -> str:
    """[SI] As a person reads it: 0.12 m is 12 cm, radians are degrees."""
    if unit.startswith("rad"):
        return f"{degrees(value):.3g} °{unit[3:]}"
    if unit == "m" and abs(value) < 1.0:
        return f"{100.0 * value:.3g} cm"
    if unit == "m/s" and abs(value) < 1.0:
        return f"{100.0 * value:.3g} cm/s"
    return f"{value:.3g} {unit}"


def signed(value: float, unit: str) -> str:
    return f"{'+' if value > 0.0 else ''}{amount(value, unit)}"


def _dive(found: Review) -> Iterator[str]:
    armed = "" if found.armed_s is None else f", armed {found.armed_s:.0f} s"
    deepest = "" if found.deepest is None else f", down to {found.deepest:.1f} m"
    force = [axis.shaken_rms for axis in found.vibration if axis.unit == "m/s²"]
    rough = f", the IMU shaken by {max(force):.2g} m/s² (rms) at its roughest" if force else ""
    yield f"The dive: {found.seconds:.0f} s{armed}{deepest}{rough}."


def _verdict(found: Review) -> str:
    known = found.estimation.known_s / max(found.seconds - found.estimation.calibrating_s, 1.0)
    if not found.estimation.runs:
        return "Lindy could not have flown it: from this recording it cannot tell where it was."
    if not found.estimation.known_s:
        return "Lindy could not have flown it: it never knew roll, pitch and depth together."
    if known < ENOUGH_KNOWN:
        return (
            f"Lindy could not have flown all of it: after {found.estimation.calibrating_s:.0f} s "
            f"of calibration it knew roll, pitch and depth for {known:.0%} of the rest."
        )
    return (
        f"By its sensors Lindy could have flown it: after {found.estimation.calibrating_s:.0f} s "
        f"of calibration it knew roll, pitch and depth for {min(known, 1.0):.0%} of the rest."
    )


def _missing(found: Review) -> Iterator[str]:
    """What the other sentences do not say, each once."""
    lacking = dict.fromkeys(
        # Which messages were too few is for the section.
        f"{line.split(': ')[0].rstrip('.')}." if key == "stops_with_lindy" else line
        for key, lines in found.missing.items()
        if FOLLOWS.get(key) not in found.missing
        for line in lines
    )
    if lacking:
        yield f"Not in this dive: {_plain(' '.join(lacking))}"


def _plain(text: str) -> str:
    """Without the keys that name a sensor for programs."""
    return re.sub(r" \(sensor/\w+\)", "", text)


def whose(found: Review) -> str:
    """The estimate that Lindy's of today is compared with."""
    if found.imported_from:
        return "the vehicle's own estimate"
    return "the estimate that was recorded in the dive"


def _sensors(found: Review) -> Iterator[str]:
    odd = [
        f"{s.key.removeprefix('sensor/')}: {', '.join(s.remarks)}"
        for s in found.sensors
        if s.remarks
    ]
    names = ", ".join(s.key.removeprefix("sensor/") for s in found.sensors)
    if not found.sensors:
        yield "The recording holds no sensors."
    else:
        seen = f"Odd: {'; '.join(odd)}" if odd else "No gaps, repeats or wrong stamps"
        yield f"Recorded: {names}. {seen}."


def _vibration(found: Review) -> Iterator[str]:
    force = [axis for axis in found.vibration if axis.unit == "m/s²"]
    if not force:
        return
    worst = max(force, key=lambda axis: axis.shaken_density)
    ratio = worst.shaken_density / worst.quiet_density if worst.quiet_density else 0.0
    line = f", strongest at {worst.peak_hz:.0f} Hz" if worst.peak_hz is not None else ""
    yield (
        f"Vibration: along {worst.name.split()[1]} the most shaken fifth of the dive has "
        f"{worst.shaken_density:.2g} m/s²/√Hz, {ratio:.1f} times the quietest{line}."
    )


def _estimation(found: Review) -> Iterator[str]:
    estimation = found.estimation
    if not estimation.runs:
        return
    by = {each.name: each for each in estimation.beside}
    parts = [
        f"{name.replace('_', ' ')} {amount(by[name].rms, by[name].unit)}"
        for name in ("roll", "pitch", "heading", "depth", "depth_rate")
        if name in by
    ]
    if parts and not any(each.rms for each in estimation.beside):
        yield f"Lindy's estimate is the same as {whose(found)}."
    elif parts:
        yield f"Lindy's estimate differs from {whose(found)} by (rms) {', '.join(parts)}."


def _stops(found: Review) -> Iterator[str]:
    for axis in STICKS:
        of_axis = [stop for stop in found.stops if stop.axis == axis and stop.ran_on is not None]
        if of_axis:
            yield _stops_of(axis, of_axis)


BY = {"truth": "the simulator's truth", "estimate": "the estimate"}


def _stops_of(axis: str, stops: list[ReviewedStop]) -> str:
    unit = "rad" if axis == "yaw" else "m"
    ran = median(stop.ran_on or 0.0 for stop in stops)
    back = median(stop.bounced_back or 0.0 for stop in stops)
    said = (
        f"{len(stops)} stop{'s' * (len(stops) > 1)} in {axis}, by {BY[stops[0].by]}: it ran on by "
        f"{amount(ran, unit)}{' (median)' * (len(stops) > 1)} and came back by {amount(back, unit)}"
    )
    lindy = [stop.lindy_ran_on for stop in stops if stop.lindy_ran_on is not None]
    more = f"; Lindy's reference runs on by {amount(median(lindy), unit)}" if lindy else ""
    return f"{said}{more}."


def _measurements(found: Review) -> Iterator[str]:
    rejected = [
        f"{in_words(m.name)} {m.rejected:.0%}{f': {_plain(m.words[0])}' if m.words else ''}"
        for m in found.measurements if m.rejected > 0.01
    ]  # fmt: skip
    if rejected:
        yield f"Rejected measurements: {'; '.join(rejected)}."
        mostly = (
            row_of(event).to_do
            for m in found.measurements if m.rejected > 0.5 for event in m.reasons
        )  # fmt: skip
        yield from (f"What helps: {to_do}." for to_do in dict.fromkeys(mostly) if to_do)
    elif found.measurements:
        yield "Nearly all measurements were used."
