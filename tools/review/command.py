"""The verb `lindy review`: every figure of the page, the page, and what it says in short."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from html import escape
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from cyclopts import Parameter

from messages import topics
from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import Json, Overrides, named
from tools.exit_status import DONE, LOST
from tools.fresh import free_name, refuse_existing, write_fresh
from tools.importing.command import import_log
from tools.importing.rosbag_file import is_rosbag
from tools.packages import require_package
from tools.recordings.recording import open_recording
from tools.replay.source import ReplaySource, remarks
from tools.review.estimated import Measurement, MeasurementSection, estimate, plain
from tools.review.estimation import EstimationSection, ReviewedEstimation
from tools.review.recorded import read
from tools.review.section import ReviewSection
from tools.review.sensors import AxisVibration, SensorSection, SensorStream, VibrationSection
from tools.review.stops import ReviewedStop, StopSection, reviewed_stops

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
    measurements: list[Measurement]
    missing: dict[str, list[str]]  # section: what it lacks, in sentences
    remarks: list[str]  # what a reader should know of the recording


class Reviewed(NamedTuple):
    figures: Review
    sections: Sequence[ReviewSection]  # in the order of the page
    short: list[str]  # what the page says, in sentences
    source: ReplaySource


def reviewed(path: Path, overrides: tuple[str, ...] = ()) -> Reviewed:
    """
    Args:
        path: a recording of Lindy.
        overrides: key.path=value into the vehicle file, besides those of the dive.

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
        line
        for key, lines in found.missing.items()
        # That nothing was compared follows from what the estimation lacks.
        if not (key == "measurements" and "estimation" in found.missing)
        for line in lines
    )
    if lacking:
        yield f"Not in this dive: {plain(' '.join(lacking))}"


RECORDING = ".mcap"


def review(
    file: Annotated[
        Path,
        Parameter(
            converter=named,
            help="a dive's folder or its MCAP file, or a log that `lindy import` reads",
        ),
    ],
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="the page to write, a new file; default: review.html beside the recording, or "
            "the next free name",
        ),
    ] = None,
    map_: Annotated[
        str | None,
        Parameter(name="--map", help="as `lindy import` takes it, for a log of another program"),
    ] = None,
    vehicle: Annotated[
        str | None, Parameter(help="as `lindy import` takes it, for a log of another program")
    ] = None,
    set_: Overrides = (),
    json: Json = False,
) -> int:
    """Review a dive of any vehicle: one page with plots.

    What the recording holds, vibration, Lindy's estimation beside the vehicle's own, every stop,
    and what was rejected. A log of another program is imported first, into a new folder beside it.
    With --json the same figures are printed, and no page is written unless --out names one. Exit
    status 3: the recording is damaged or not whole, and this is of what can be read.

    Example: lindy review 00000042.BIN
             lindy review dives/latest --out yesterday.html
    """
    writes = out is not None or not json
    if writes:
        require_package("matplotlib", "figures", "the page")
    if out is not None:
        if out.suffix != ".html":
            raise LindyError(f"--out {out}: expected a name that ends in .html")
        refuse_existing(out)
    recording = _recording(file, map_, vehicle)
    found = reviewed(recording, tuple(set_))
    if writes:
        folder = recording if recording.is_dir() else recording.parent
        place = out or free_name(folder, "review", ".html")
        write_fresh(place, page(found).encode())
        print(harmless(f"written {place}"), file=sys.stderr if json else sys.stdout, flush=True)
    if json:
        print(msgspec.json.format(msgspec.json.encode(found.figures), indent=1).decode())
    else:
        print(harmless("\n".join([*found.figures.remarks, *found.short])), flush=True)
    return LOST if found.source.recording.damage else DONE


def _recording(file: Path, map_: str | None, vehicle: str | None) -> Path:
    """The recording to review: this one, or a new one of a log of another program.

    Raises:
        LindyError: it cannot be imported, or options of the import are given for a recording.
    """
    if _is_ours(file):
        for option, value in (("--map", map_), ("--vehicle", vehicle)):
            if value is not None:
                raise LindyError(
                    f"{option} {value}: {file} is a recording already; {option} is for a log of "
                    f"another program"
                )
        return file
    if not file.exists():
        raise LindyError(f"there is no file {file}")
    folder = free_name(file.parent, f"{file.stem}-lindy")  # beside it
    with redirect_stdout(sys.stderr):  # --json prints figures only
        import_log(file, map_=map_, out=folder, vehicle=vehicle)
    return folder


def _is_ours(file: Path) -> bool:
    """A dive's folder, or a file that says of which dive it is.

    Raises:
        LindyError: an MCAP file that cannot be read.
    """
    if file.is_dir():
        return not is_rosbag(file)
    if file.suffix.lower() != RECORDING:
        return False
    return bool(open_recording(file).metadata("dive"))
