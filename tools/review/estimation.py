"""Where the vehicle was: Lindy's estimate, and beside it the one that was made in the dive."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from messages import topics
from messages.events import sentence
from services.marine.attitude import wrapped
from tools.recordings.columns import Array
from tools.review.estimated import Estimated
from tools.review.recorded import Recorded, Track, at, digits
from tools.review.section import (
    OURS,
    OWN,
    ReviewSection,
    amount,
    figure,
    image,
    legend_above,
    listed,
    paragraph,
    signed,
    table,
    thinned,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

COMPARED = (
    *(("roll", "rad"), ("pitch", "rad"), ("heading", "rad")),
    *(("depth", "m"), ("depth_rate", "m/s"), ("yaw_rate", "rad/s")),
)
ZEROED = ("heading", "depth")  # each counts from its own north and surface
COLUMNS = {"heading": "bearing"}  # of a track, by what is compared
FEWEST = 20
KNOWN_SHARE = 0.5  # [-] of the dive: less, and the page says that the estimator did not work
ENOUGH_KNOWN = 0.95  # [-] of the time after calibration: less, and it would have stopped under way
ANGLES = ("roll", "pitch", "heading", "yaw_rate")
TRACKS = (
    *(("roll", "roll [°]"), ("pitch", "pitch [°]"), ("heading", "heading [°]")),
    *(("depth", "depth [m]"), ("depth_rate", "depth rate [m/s]")),
)


class ComparedEstimate(msgspec.Struct, kw_only=True, frozen=True):
    """One quantity: Lindy's minus the vehicle's own."""

    name: str
    unit: str
    rms: float  # root mean square of the difference, without `offset`
    worst: float
    offset: float  # of heading and depth: the middle difference, of two norths and two surfaces
    samples: int


def beside(ours: Track, own: Track) -> list[ComparedEstimate]:
    """Those quantities that both know."""
    found: list[ComparedEstimate] = []
    for name, unit in COMPARED:
        column = COLUMNS.get(name, name)
        t, theirs = own.known(column)
        difference = at(ours, column, t) - theirs
        difference = difference[np.isfinite(difference)]
        if len(difference) >= FEWEST:
            found.append(_compared(name, unit, difference))
    return found


def _compared(name: str, unit: str, difference: Array) -> ComparedEstimate:
    offset = _middle(name, difference) if name in ZEROED else 0.0
    left = difference - offset
    if unit == "rad":
        left = in_one_turn(left)
    return ComparedEstimate(
        name=name,
        unit=unit,
        rms=digits(float(np.sqrt(np.mean(left**2)))),
        worst=digits(float(np.max(np.abs(left)))),
        offset=digits(offset),
        samples=len(left),
    )


def _middle(name: str, difference: Array) -> float:
    """The middle difference; of headings within half a turn."""
    if name != "heading":
        return float(np.median(difference))
    mean = float(np.angle(np.mean(np.exp(1j * difference))))
    return wrapped(mean + float(np.median(in_one_turn(difference - mean))))


def in_one_turn(angle: Array) -> Array:
    """[rad] in [-π, π)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


class ReviewedEstimation(msgspec.Struct, kw_only=True, frozen=True):
    """How Lindy's estimation ran over the dive."""

    runs: bool
    calibrating_s: float  # [s] until it ran; the whole dive, where it never did
    known_s: float  # [s] in which roll, pitch and depth were known
    troubles: list[str]  # which sensors could not be used, in words, the most frequent first
    beside: list[ComparedEstimate]  # with what was estimated in the dive


class EstimationSection(ReviewSection):
    key, heading = "estimation", "Where it was: Lindy's estimate"

    def __init__(self, recorded: Recorded, estimated: Estimated) -> None:
        super().__init__()
        self._recorded, self._ours, self._own = recorded, estimated.track, recorded.own
        known = 0.0 if self._ours is None else self._ours.seconds_known
        self._require_known(estimated, known)
        compared: list[ComparedEstimate] = []
        if self._own is None:
            self.missing.append(
                "The recording holds no estimate of the vehicle's own to compare with."
            )
        elif self._ours is not None and round(known, 1):
            compared = beside(self._ours, self._own)
            headings = any(each.name == "heading" for each in compared)
            if len(self._own.known("bearing")[0]) and not headings:
                has = "compass" in estimated.aids
                no = "there is no compass, and gyroscopes alone drift"
                why = "the compass was rejected" if has else no
                self.missing.append(f"Heading: not known: {why}.")
        self.found = ReviewedEstimation(
            runs=estimated.runs,
            calibrating_s=round(estimated.calibrating_s, 1),
            known_s=round(known, 1),
            troubles=[sentence(event) for event, _ in estimated.troubles.most_common()],
            beside=compared,
        )
        imported = "imported" in recorded.source.about
        was_recorded = "the estimate that was recorded in the dive"
        self._whose = "the vehicle's own estimate" if imported else was_recorded

    def _require_known(self, estimated: Estimated, known: float) -> None:
        recorded = self._recorded
        if topics.IMU.key not in recorded.sensors:
            self.missing.append(
                "The recording holds no IMU, so Lindy's estimation had nothing to run on."
            )
        elif not estimated.runs:
            why = f": {sentence(estimated.blocked_by)}" if estimated.blocked_by else ""
            rest = recorded.settings.estimation.calibration.still_time
            self.missing.append(
                f"Lindy's estimation never got beyond calibrating: it wants {rest:g} s at rest at "
                f"the surface before the dive, and this recording does not have them{why}."
            )
        elif known < KNOWN_SHARE * recorded.seconds:
            nothing = "" if round(known, 1) else "; nothing is compared"
            self.missing.append(
                f"Lindy's estimation knew roll, pitch and depth together for {known:.0f} of "
                f"{recorded.seconds:.0f} s only{nothing}."
            )

    def verdict(self) -> str:
        """Whether its sensors would have done, in a sentence."""
        found = self.found
        known = found.known_s / max(self._recorded.seconds - found.calibrating_s, 1.0)
        if not found.runs:
            return "Lindy could not have flown it: from this recording it cannot tell where it was."
        if not found.known_s:
            return "Lindy could not have flown it: it never knew roll, pitch and depth together."
        could = "By its sensors Lindy could have flown it"
        if known < ENOUGH_KNOWN:
            could = "Lindy could not have flown all of it"
        return (
            f"{could}: after {found.calibrating_s:.0f} s of calibration it knew roll, pitch and "
            f"depth for {min(known, 1.0):.0%} of the rest."
        )

    def sentences(self) -> Iterator[str]:
        if not self.found.runs:
            return
        by = {each.name: each for each in self.found.beside}
        parts = [
            f"{name.replace('_', ' ')} {amount(by[name].rms, by[name].unit)}"
            for name in ("roll", "pitch", "heading", "depth", "depth_rate")
            if name in by
        ]
        if parts and not any(each.rms for each in self.found.beside):
            yield f"Lindy's estimate is the same as {self._whose}."
        elif parts:
            yield f"Lindy's estimate differs from {self._whose} by (rms) {', '.join(parts)}."

    def html(self) -> str:
        found = self.found
        rows = [
            (c.name.replace("_", " "), amount(c.rms, c.unit), amount(c.worst, c.unit),
             signed(c.offset, c.unit) if c.offset else "–", c.samples)
            for c in found.beside
        ]  # fmt: skip
        heads = ("", "differs, rms", "at most", "taken off", "samples")
        said = f"It knew roll, pitch and depth for {found.known_s:.0f} s, after "
        said += f"{found.calibrating_s:.0f} s of calibration."
        parts = [paragraph(said)] if found.runs else []
        if found.runs or self._own is not None:
            parts.append(image(self._motion(), "The motion over time"))
        if rows:
            parts.append(table(heads, rows))
            parts.append(
                paragraph("Taken off: heading and depth count from two norths and two surfaces.")
            )
        parts.append(listed("Sensors that could not be used at times:", found.troubles))
        return "".join(parts)

    def _motion(self) -> "Figure":
        offsets = {each.name: each.offset for each in self.found.beside}
        drawn = figure(8.5)
        rows: Sequence[Panel] = drawn.subplots(len(TRACKS), 1, sharex=True)
        for panel, (name, label) in zip(rows, TRACKS, strict=True):
            for track, colour, who, off in (
                (self._own, OWN, self._whose, 0.0),
                (self._ours, OURS, "Lindy's estimation of today", offsets.get(name, 0.0)),
            ):
                if track is not None:
                    t, values = thinned(*track.known(COLUMNS.get(name, name)))
                    if len(t):
                        values = values - off
                        if name == "heading":
                            t, values = _in_one_turn(t, values)
                        shown = np.degrees(values) if name in ANGLES else values
                        panel.plot(*_with_breaks(t, shown), color=colour, linewidth=1.1, label=who)
            panel.set_ylabel(label)
            panel.grid(alpha=0.3)
            if name == "depth":
                panel.invert_yaxis()
        rows[-1].set_xlabel("time since the recording began [s]")
        legend_above(drawn, rows)
        return drawn


def _with_breaks(t: Array, values: Array) -> tuple[Array, Array]:
    """A line is not drawn over what is not known."""
    if len(t) < 2:
        return t, values
    periods = np.diff(t)
    after = np.flatnonzero(periods > max(1.0, 10.0 * float(np.median(periods)))) + 1
    return np.insert(t, after, np.nan), np.insert(values, after, np.nan)


def _in_one_turn(t: Array, heading: Array) -> tuple[Array, Array]:
    """[rad] No line from one end of the turn to the other."""
    values = in_one_turn(heading)
    ends = np.flatnonzero(np.abs(np.diff(values)) > np.pi) + 1
    return np.insert(t, ends, t[ends]), np.insert(values, ends, np.nan)
