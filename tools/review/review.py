"""A review: every figure of the page, the page, and what it says in short."""

import sys
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from messages import topics
from tools.replay.source import ReplaySource, remarks
from tools.review.estimated import Measurement, MeasurementSection, estimate, plain
from tools.review.estimation import EstimationSection, ReviewedEstimation
from tools.review.recorded import read
from tools.review.section import ReviewSection
from tools.review.sensors import AxisVibration, SensorSection, SensorStream, VibrationSection
from tools.review.stops import ReviewedStop, StopSection, StopsWithLindySection, reviewed_stops
from tools.review.with_lindy import stops_with_lindy

SHOWN = 3  # keys that a sentence names
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 58rem; margin: 2rem auto; padding: 0 1rem;
  color: #222; background: #fff; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.5rem; border-top: 1px solid #ccc; padding-top: 1rem; }
table { border-collapse: collapse; font-size: 0.88rem; margin: 1rem 0; }
th, td { padding: 0.2rem 0.7rem 0.2rem 0; text-align: right; vertical-align: top; }
th { border-bottom: 1px solid #999; font-weight: 600; }
th:first-child, td:first-child, td.words, th.words { text-align: left; }
img { max-width: 100%; } pre { background: #f2f2f2; padding: 0.8rem; overflow-x: auto; }
.missing { background: #fff4d6; padding: 0.5rem 0.8rem; } .about { color: #555; }
.short li { margin: 0.3rem 0; }
"""


class Review(msgspec.Struct, kw_only=True, frozen=True):
    """Every figure, as `--json` prints them."""

    file: str
    imported_from: str  # name of the log of another program; empty: a recording of Lindy
    vehicle: str  # name of the vehicle file
    seconds: float  # [s]
    armed_s: float | None  # [s] None: the recording does not say
    deepest: float | None  # [m] None: nobody estimated the depth
    sensors: list[SensorStream]
    vibration: list[AxisVibration]
    estimation: ReviewedEstimation
    stops: list[ReviewedStop]
    stops_with_lindy: list[ReviewedStop]  # the same sticks on the identified vehicle, simulated
    measurements: list[Measurement]
    missing: dict[str, list[str]]  # section: what it lacks, in sentences
    remarks: list[str]  # what a reader should know of the recording


class Reviewed(NamedTuple):
    figures: Review
    sections: Sequence[ReviewSection]  # in the order of the page
    short: list[str]  # what the page says, in sentences
    source: ReplaySource


def review(path: Path, overrides: tuple[str, ...] = (), *, quick: bool = False) -> Reviewed:
    """
    Args:
        path: a recording of Lindy.
        overrides: key.path=value into the vehicle file, besides those of the dive.
        quick: the vehicle is not identified, and nothing flown again.

    Raises:
        LindyError: not a recording of Lindy, nothing in it, or wrong settings.
    """
    recorded = read(path, overrides)
    estimated = estimate(recorded.source, overrides)
    motion = estimated.track if estimated.runs else recorded.own
    depth = np.empty(0) if motion is None else motion.known("depth")[1]
    imu, armed = recorded.sensors.get(topics.IMU.key), recorded.armed
    found = reviewed_stops(recorded.dive, motion, imu, recorded.settings.reference, armed)
    sections = (
        sensors := SensorSection(recorded.sensors),
        vibration := VibrationSection(imu),
        estimation := EstimationSection(recorded, estimated),
        stops := StopSection(found),
        measurements := MeasurementSection(estimated),
        flown := StopsWithLindySection(_with_lindy(path, recorded.begin_ns, quick=quick)),
    )
    about, keys = recorded.source.about, sorted(recorded.source.recording.unreadable)
    more = f" and {len(keys) - SHOWN} more" if len(keys) > SHOWN else ""
    unread = [f"some messages of {', '.join(keys[:SHOWN])}{more} could not be read"] * bool(keys)
    figures = Review(
        file=str(path),
        imported_from=about.get("imported", ""),
        vehicle=about.get("vehicle", ""),
        seconds=round(recorded.seconds, 1),
        armed_s=None if armed is None else round(sum(span.seconds for span in armed), 1),
        deepest=round(float(depth.max()), 2) if len(depth) else None,
        sensors=sensors.streams,
        vibration=vibration.axes,
        estimation=estimation.found,
        stops=stops.stops,
        stops_with_lindy=flown.stops,
        measurements=measurements.measurements,
        missing={section.key: section.missing for section in sections if section.missing},
        remarks=[*remarks(recorded.source), *unread],
    )
    short = [_dive(figures, vibration), estimation.verdict()]
    short += [said for section in sections for said in section.sentences()]
    return Reviewed(figures, sections, [*short, *_missing(figures)], recorded.source)


def page(of: Reviewed) -> str:
    """The HTML."""
    found = of.figures
    log = f"imported from {found.imported_from}, " if found.imported_from else ""
    armed = "" if found.armed_s is None else f", armed {found.armed_s:.0f} s"
    about = f"{log}vehicle file {found.vehicle}, {found.seconds:.0f} s{armed}"
    short = "".join(f"<li>{escape(line)}</li>" for line in of.short)
    remarks = "".join(f'<p class="missing">{escape(line)}</p>' for line in found.remarks)
    sections = "".join(section.whole() for section in of.sections)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width">'
        f"<title>Review of {escape(found.file)}</title><style>{STYLE}</style></head><body>"
        f'<h1>Your dive, reviewed</h1><p class="about">{escape(found.file)}: {escape(about)}</p>'
        f'{remarks}<h2>In short</h2><ul class="short">{short}</ul>{sections}'
        f'<p class="about">Made by lindy review. The same figures: '
        f"lindy review --json {escape(found.file)}</p></body></html>\n"
    )


def _dive(found: Review, vibration: VibrationSection) -> str:
    armed = "" if found.armed_s is None else f", armed {found.armed_s:.0f} s"
    deepest = "" if found.deepest is None else f", down to {found.deepest:.1f} m"
    rms = max((axis.shaken_rms for axis in vibration.forces), default=None)
    rough = "" if rms is None else f", the IMU shaken by {rms:.2g} m/s² (rms) at its roughest"
    return f"The dive: {found.seconds:.0f} s{armed}{deepest}{rough}."


def _missing(found: Review) -> Iterator[str]:
    """What the other sentences do not say, each once."""
    lacking = dict.fromkeys(
        # Which messages were too few is for the section.
        f"{line.split(': ')[0].rstrip('.')}." if key == "stops_with_lindy" else line
        for key, lines in found.missing.items()
        # That nothing was compared follows from what the estimation lacks.
        if not (key == "measurements" and "estimation" in found.missing)
        for line in lines
    )
    if lacking:
        yield f"Not in this dive: {plain(' '.join(lacking))}"


def _with_lindy(path: Path, begin_ns: int, *, quick: bool) -> list[ReviewedStop] | str:
    if quick:
        return "Your sticks were not flown again, as --quick asks."
    print(
        "lindy: identifies the vehicle and flies it again, which may take minutes",
        file=sys.stderr,
        flush=True,
    )
    return stops_with_lindy(path, begin_ns)
