"""What the recording holds of each sensor, and spectra of the IMU in the quiet and in the shaken
part of the dive.

At rest an IMU hears its own noise; under way it hears thrusters, frame and water, which is what a
filter under way has to expect. So the dive is cut into windows, and by their vibration the quietest
and the most shaken fifth are told apart. No sticks or thrusters need to be in the recording.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from tools.analysis.spectra import Spectrum, spectrum
from tools.recordings.columns import Array
from tools.review.recorded import PAUSE, SensorColumns, digits
from tools.review.section import ReviewSection, figure, image, paragraph, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SHORTEST_GAP_S = 0.25  # [s] less is jitter
GAP_PERIODS = 10  # a pause of so many usual periods is a gap
LEARNT = 50  # periods from which the usual one is taken
USUAL = 3  # samples of which a rate can be told
LONG_ENOUGH_S = 10.0  # [s] of which a drift can be told
ODD_DRIFT_PPM = 200.0  # [1e-6] crystals are within 100
ODD_RATE = 2.0  # [-] times the rate that estimation expects of the IMU, or its inverse


class SensorStream(msgspec.Struct, kw_only=True, frozen=True):
    """One sensor's samples."""

    key: str
    samples: int
    per_second: float  # [1/s] between pauses
    gaps: int  # pauses of ten usual periods, at least 0.25 s
    longest_gap_s: float | None  # [s] None: no gap
    first_gap_s: float | None  # [s] since the recording began
    jitter_ms: float  # [ms] 90 % of the periods are within this
    late_ms: float  # [ms] median from stamp to arrival
    latest_ms: float  # [ms] in 99 of 100 cases below
    drift_ppm: float | None  # [1e-6] of the arrival against the stamp; None: too short
    repeated: int  # samples with the same values as the one before; of those that measure
    not_newer: int  # samples left out: stamped no later than one before
    remarks: list[str]


class SensorSection(ReviewSection):
    key, heading = "sensors", "What the recording holds"

    def __init__(self, sensors: Mapping[str, SensorColumns]) -> None:
        """
        Args:
            sensors: in the order of the topic table.
        """
        super().__init__()
        self.streams = [_stream(key, columns) for key, columns in sensors.items()]

    def sentences(self) -> Iterator[str]:
        named = {s.key.removeprefix("sensor/"): ", ".join(s.remarks) for s in self.streams}
        odd = "; ".join(f"{name}: {said}" for name, said in named.items() if said)
        if not named:
            yield "The recording holds no sensors."
        else:
            seen = f"Odd: {odd}" if odd else "No gaps, repeats or wrong stamps"
            yield f"Recorded: {', '.join(named)}. {seen}."

    def html(self) -> str:
        rows = [
            (s.key.removeprefix("sensor/"), s.samples, s.per_second, s.gaps, s.longest_gap_s,
             s.jitter_ms, s.late_ms, s.latest_ms, "; ".join(s.remarks))
            for s in self.streams
        ]  # fmt: skip
        heads = ("sensor", "samples", "per second", "gaps", "longest [s]", "jitter [ms]",
                 "late [ms]", "latest [ms]", "odd")  # fmt: skip
        return table(heads, rows, words=1) + paragraph(
            "Late: from a sample's own stamp to its arrival in the log, the middle and 99 of 100. "
            "Jitter: nine of ten periods differ by less."
        )


def _stream(key: str, columns: SensorColumns) -> SensorStream:
    t, late = columns.stamp, 1e3 * (columns.arrival - columns.stamp)
    periods = np.diff(t)
    usual = float(np.median(periods[:LEARNT])) if len(periods) else 0.0
    gaps = np.flatnonzero(periods > max(SHORTEST_GAP_S, GAP_PERIODS * usual))
    jitter = float(np.subtract(*np.percentile(periods, (95, 5)))) if len(periods) else 0.0
    drift = None
    if len(t) >= USUAL and t[-1] - t[0] >= LONG_ENOUGH_S:
        drift = digits(1e6 * float(np.polyfit(t, columns.arrival - t, 1)[0]), 4)
    found = SensorStream(
        key=key,
        samples=len(t),
        per_second=digits(columns.per_second, 4),
        gaps=len(gaps),
        longest_gap_s=digits(float(periods.max()), 4) if len(gaps) else None,
        first_gap_s=digits(float(t[gaps[0]]), 4) if len(gaps) else None,
        jitter_ms=round(1e3 * jitter, 3),
        late_ms=round(float(np.median(late)), 3),
        latest_ms=round(float(np.percentile(late, 99)), 3),
        drift_ppm=drift,
        repeated=columns.repeated,
        not_newer=columns.not_newer,
        remarks=[],
    )
    return msgspec.structs.replace(found, remarks=_remarks(found))


def _remarks(stream: SensorStream) -> list[str]:
    """What is odd, in words for the owner."""
    said: list[str] = []
    if stream.key == topics.IMU.key:
        said += _rate_remarks(stream.per_second)
    if stream.gaps:
        said.append(f"{stream.gaps} gaps, the longest {stream.longest_gap_s:g} s")
    if stream.drift_ppm is not None and abs(stream.drift_ppm) > ODD_DRIFT_PPM:
        said.append(f"its clock drifts by {stream.drift_ppm:.0f} millionths")
    if stream.late_ms < 0.0:
        said.append("stamped later than it arrived")
    if stream.repeated:
        said.append(f"the same values again ({stream.repeated})")  # as `lindy import` says it
    if stream.not_newer:
        said.append(f"{stream.not_newer} not newer than the one before, left out")
    return said


def _rate_remarks(per_second: float) -> list[str]:
    hz = topics.IMU.hz
    has = f"{per_second:.3g} samples a second, where Lindy's estimation is made for {hz:g}:"
    says = f"in the vehicle file: `[estimation.watch]`, `imu_rate = {per_second:.3g}`"
    if per_second < hz / ODD_RATE:
        return [f"{has} fast motion is missed, and roll, pitch and depth are known less ({says})"]
    if per_second > hz * ODD_RATE:
        return [f"{has} that takes longer, and is no worse ({says})"]
    return []


AXES = (
    *(("gyroscope roll", "rad/s"), ("gyroscope pitch", "rad/s"), ("gyroscope yaw", "rad/s")),
    *(("accelerometer surge", "m/s²"), ("accelerometer sway", "m/s²")),
    ("accelerometer heave", "m/s²"),
)
WINDOW_S, FEWEST = 2.0, 64  # [s], samples: the longer of the two is a window
PART = 0.2  # [-] of all windows: the quietest, and the most shaken
LEAST_WINDOWS = 5
MOTION_HZ = 5.0  # [Hz] a vehicle's own motion is below
LEAST_RATE = 4.0 * MOTION_HZ  # [1/s] of samples, to see something above
PEAK = 10.0  # [-] times the floor of its spectrum: a line
WIDEST = 3  # bins above half of the top of a line


class AxisVibration(msgspec.Struct, kw_only=True, frozen=True):
    """One axis of the IMU, above the vehicle's own motion."""

    name: str
    unit: str
    quiet_density: float  # [unit/√Hz] in the quietest fifth
    shaken_density: float  # [unit/√Hz] in the most shaken fifth
    shaken_rms: float  # [unit] there, of one sample
    peak_hz: float | None  # [Hz] of the strongest line there; None: no line


class ImuVibration(NamedTuple):
    rate: float  # [1/s] of the samples
    windows: int
    seconds: float  # [s] of a window
    axes: list[AxisVibration]
    quiet: list[Spectrum]  # by axis
    shaken: list[Spectrum]


def vibration(imu: SensorColumns) -> ImuVibration | str:
    """A sentence: what is missing."""
    if len(imu.stamp) < FEWEST:
        return f"The recording holds {len(imu.stamp)} samples of the IMU; {FEWEST} are a spectrum."
    rate = imu.per_second
    if rate < LEAST_RATE:
        return (
            f"The IMU has {rate:.3g} samples a second; vibration is seen from {LEAST_RATE:g} on. A "
            f"board's own log (.bin) has more than a ground station's (.tlog)."
        )
    length = max(FEWEST, round(WINDOW_S * rate))
    pieces = _windows(imu, rate, length)
    if len(pieces) < LEAST_WINDOWS:
        return (
            f"Stretches of {length / rate:.0f} s that the IMU has without a gap: {len(pieces)}; a "
            f"review needs {LEAST_WINDOWS} to tell quiet from shaken."
        )
    spectra = [[spectrum(piece[:, k], rate, length) for k in range(6)] for piece in pieces]
    power = np.array(
        [sum(s.density[s.frequency >= MOTION_HZ].sum() for s in each[3:6]) for each in spectra]
    )
    order, count = np.argsort(power), max(1, round(PART * len(pieces)))
    quiet = [_mean([spectra[n][k] for n in order[:count]]) for k in range(6)]
    shaken = [_mean([spectra[n][k] for n in order[-count:]]) for k in range(6)]
    axes = [_axis(*named, quiet[k], shaken[k]) for k, named in enumerate(AXES)]
    return ImuVibration(rate, len(pieces), length / rate, axes, quiet, shaken)


def _windows(imu: SensorColumns, rate: float, length: int) -> list[NDArray[np.float64]]:
    """(length, 6) Evenly spaced samples: rates and forces."""
    gap_before = np.append(0, np.cumsum(np.diff(imu.stamp) > PAUSE / rate))
    found: list[NDArray[np.float64]] = []
    for begin in np.arange(imu.stamp[0], imu.stamp[-1] - length / rate, length / rate):
        at = begin + np.arange(length) / rate
        first, last = np.searchsorted(imu.stamp, (at[0], at[-1]), side="right") - 1
        if gap_before[first] == gap_before[last]:
            columns: list[Array] = [np.interp(at, imu.stamp, each) for each in imu.values.T]
            found.append(np.column_stack(columns))
    return found


def _mean(spectra: list[Spectrum]) -> Spectrum:
    return Spectrum(spectra[0].frequency, np.mean([one.density for one in spectra], axis=0))


def _axis(name: str, unit: str, quiet: Spectrum, shaken: Spectrum) -> AxisVibration:
    high = shaken.frequency >= MOTION_HZ
    density: Array = shaken.density[high]
    top = int(np.argmax(density))
    # The flank of the vehicle's own motion is none: a line is narrow, and has two flanks.
    wide = np.count_nonzero(density > density[top] / 2.0) > WIDEST
    is_line = top > 0 and not wide and density[top] > PEAK * float(np.median(density))
    step = shaken.frequency[1] - shaken.frequency[0]
    return AxisVibration(
        name=name,
        unit=unit,
        quiet_density=digits(_density(quiet)),
        shaken_density=digits(_density(shaken)),
        shaken_rms=digits(float(np.sqrt(density.sum() * step))),
        peak_hz=digits(float(shaken.frequency[high][top])) if is_line else None,
    )


def _density(of: Spectrum) -> float:
    """[unit/√Hz] Above a frequency, as white noise has it: a line of a propeller does not count."""
    return float(np.sqrt(np.median(of.density[of.frequency >= MOTION_HZ])))


class VibrationSection(ReviewSection):
    key, heading = "vibration", "Noise and vibration"

    def __init__(self, imu: SensorColumns | None) -> None:
        found = "The recording holds no IMU." if imu is None else vibration(imu)
        super().__init__([found] if isinstance(found, str) else [])
        self._found = None if isinstance(found, str) else found
        self.axes = [] if self._found is None else self._found.axes
        self.forces = [axis for axis in self.axes if axis.unit == "m/s²"]

    def sentences(self) -> Iterator[str]:
        if not self.forces:
            return
        worst = max(self.forces, key=lambda axis: axis.shaken_density)
        ratio = worst.shaken_density / worst.quiet_density if worst.quiet_density else 0.0
        line = f", strongest at {worst.peak_hz:.0f} Hz" if worst.peak_hz is not None else ""
        yield (
            f"Vibration: along {worst.name.split()[1]} the most shaken fifth of the dive has "
            f"{worst.shaken_density:.2g} m/s²/√Hz, {ratio:.1f} times the quietest{line}."
        )

    def html(self) -> str:
        if self._found is None:
            return ""
        rows = [
            (a.name, a.unit, a.quiet_density, a.shaken_density, a.shaken_rms, a.peak_hz)
            for a in self.axes
        ]
        heads = ("axis", "unit", "quiet [/√Hz]", "shaken [/√Hz]", "shaken, rms", "line at [Hz]")
        return (
            paragraph(
                f"The quietest and the most shaken fifth of the dive, above {MOTION_HZ:g} Hz, "
                "where a vehicle does not move by itself: what is there is noise, thrusters and "
                "frame. A line is something that turns or rings."
            )
            + image(_spectra(self._found), "Spectra of accelerometer and gyroscope")
            + table(heads, rows)
        )


def _spectra(found: ImuVibration) -> "Figure":
    drawn = figure(4.2)
    panels = drawn.subplots(1, 2)
    for panel, first, unit in ((panels[0], 3, "m/s²"), (panels[1], 0, "rad/s")):
        for k in range(first, first + 3):
            name, colour = AXES[k][0].split()[1], f"C{k % 3}"
            for one, style, what in (
                (found.quiet[k], ":", "quiet"),
                (found.shaken[k], "-", "shaken"),
            ):
                shown = (one.frequency > 0.0) & (one.density > 0.0)
                if not shown.any():  # a constant
                    continue
                panel.loglog(
                    one.frequency[shown], np.sqrt(one.density[shown]), style,
                    color=colour, linewidth=1.2, label=f"{name}, {what}",
                )  # fmt: skip
        panel.axvline(MOTION_HZ, color="0.6", linewidth=0.8)
        panel.set_title("accelerometer" if first else "gyroscope")
        panel.set_ylabel(f"[{unit}/√Hz]")
        panel.set_xlabel("frequency [Hz]")
        panel.grid(alpha=0.3)
        if panel.get_legend_handles_labels()[1]:
            panel.legend(fontsize="x-small")
    return drawn
