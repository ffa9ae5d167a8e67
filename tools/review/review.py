"""A review: every figure of the page, and what the page draws."""

import sys
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages import topics
from messages.events import sentence
from tools.replay.source import remarks
from tools.review.beside import ComparedEstimate, beside
from tools.review.estimated import Estimated, Measurement, estimate
from tools.review.recorded import Recorded, Track, read
from tools.review.sensor_table import SensorStream, sensor_table
from tools.review.stick_stops import ReviewedStop, Stops, reviewed_stops
from tools.review.vibration import AxisVibration, ImuVibration, vibration
from tools.review.with_lindy import stops_with_lindy

KNOWN_SHARE = 0.5  # [-] of the dive: less, and the page says that the estimator did not work
SHOWN = 3  # keys that a sentence names


class ReviewedEstimation(msgspec.Struct, kw_only=True, frozen=True):
    """How Lindy's estimation ran over the dive."""

    runs: bool
    calibrating_s: float  # [s] until it ran; the whole dive, where it never did
    known_s: float  # [s] in which roll, pitch and depth were known
    troubles: list[str]  # which sensors could not be used, in words, the most frequent first
    beside: list[ComparedEstimate]  # with what was estimated in the dive


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


class Drawn(NamedTuple):
    """What only the page needs."""

    recorded: Recorded
    estimated: Estimated
    vibration: ImuVibration | None
    stops: Stops


def review(
    path: Path, overrides: tuple[str, ...] = (), *, quick: bool = False
) -> tuple[Review, Drawn]:
    """
    Args:
        path: a recording of Lindy.
        overrides: key.path=value into the vehicle file, besides those of the dive.
        quick: the vehicle is not identified, and nothing flown again.

    Raises:
        LindyError: not a recording of Lindy, nothing in it, or wrong settings.
    """
    recorded = read(path, overrides)
    missing: dict[str, list[str]] = {}
    estimated = estimate(recorded.source, overrides)
    shaken = _vibration(recorded, missing)
    motion = estimated.track if estimated.runs else recorded.own
    imu = recorded.sensors.get(topics.IMU.key)
    reference, armed = recorded.settings.reference, recorded.armed
    stops = reviewed_stops(recorded.dive, motion, imu, reference, armed)
    if stops.missing:
        missing["stops"] = stops.missing
    simulated: list[ReviewedStop] = []
    if quick:
        missing["stops_with_lindy"] = ["Your sticks were not flown again, as --quick asks."]
    else:
        simulated = _with_lindy(path, recorded.begin_ns, missing)
    estimation = _estimation(recorded, estimated, missing)
    compared = estimated.innovations if estimated.runs else {}
    if not compared:
        missing["measurements"] = ["Nothing was compared, because the estimation never ran."]
    about = recorded.source.about
    found = Review(
        file=str(path),
        imported_from=about.get("imported", ""),
        vehicle=about.get("vehicle", ""),
        seconds=round(recorded.seconds, 1),
        armed_s=None if armed is None else round(sum(span.seconds for span in armed), 1),
        deepest=None if motion is None else _deepest(motion),
        sensors=sensor_table(recorded.sensors),
        vibration=[] if shaken is None else shaken.axes,
        estimation=estimation,
        stops=stops.stops,
        stops_with_lindy=simulated,
        measurements=[each.measurement(name) for name, each in compared.items()],
        missing=missing,
        remarks=[*remarks(recorded.source), *_unread(recorded)],
    )
    return found, Drawn(recorded, estimated, shaken, stops)


def _unread(recorded: Recorded) -> list[str]:
    keys = sorted(recorded.source.recording.unreadable)
    more = f" and {len(keys) - SHOWN} more" if len(keys) > SHOWN else ""
    return [f"some messages of {', '.join(keys[:SHOWN])}{more} could not be read"] if keys else []


def _vibration(recorded: Recorded, missing: dict[str, list[str]]) -> ImuVibration | None:
    imu = recorded.sensors.get(topics.IMU.key)
    found = "The recording holds no IMU." if imu is None else vibration(imu)
    if isinstance(found, str):
        missing["vibration"] = [found]
        return None
    return found


def _estimation(
    recorded: Recorded, estimated: Estimated, missing: dict[str, list[str]]
) -> ReviewedEstimation:
    known = 0.0 if estimated.track is None else estimated.track.seconds_known
    said: list[str] = []
    if topics.IMU.key not in recorded.sensors:
        said.append("The recording holds no IMU, so Lindy's estimation had nothing to run on.")
    elif not estimated.runs:
        why = f": {sentence(estimated.blocked_by)}" if estimated.blocked_by else ""
        rest = recorded.settings.estimation.calibration.still_time
        said.append(
            f"Lindy's estimation never got beyond calibrating: it wants {rest:g} s at rest at the "
            f"surface before the dive, and this recording does not have them{why}."
        )
    elif known < KNOWN_SHARE * recorded.seconds:
        said.append(
            f"Lindy's estimation knew roll, pitch and depth together for {known:.0f} of "
            f"{recorded.seconds:.0f} s only{'' if round(known, 1) else '; nothing is compared'}."
        )
    compared: list[ComparedEstimate] = []
    if recorded.own is None:
        said.append("The recording holds no estimate of the vehicle's own to compare with.")
    elif estimated.track is not None and round(known, 1):
        compared = beside(estimated.track, recorded.own)
        if len(recorded.own.known("bearing")[0]) and not any(c.name == "heading" for c in compared):
            said.append(f"Heading: not known: {_why_no_heading(estimated)}.")
    if said:
        missing["estimation"] = said
    return ReviewedEstimation(
        runs=estimated.runs,
        calibrating_s=round(estimated.calibrating_s, 1),
        known_s=round(known, 1),
        troubles=[sentence(event) for event, _ in estimated.troubles.most_common()],
        beside=compared,
    )


def _why_no_heading(estimated: Estimated) -> str:
    if "compass" not in estimated.innovations:
        return "there is no compass, and gyroscopes alone drift"
    return "the compass was rejected"


def _with_lindy(path: Path, begin_ns: int, missing: dict[str, list[str]]) -> list[ReviewedStop]:
    print(
        "lindy: identifies the vehicle and flies it again, which may take minutes",
        file=sys.stderr,
        flush=True,
    )
    found = stops_with_lindy(path, begin_ns)
    if isinstance(found, str):
        missing["stops_with_lindy"] = [found]
        return []
    return found


def _deepest(motion: Track) -> float | None:
    depth = motion.known("depth")[1]
    return round(float(depth.max()), 2) if len(depth) else None
