"""What a recording holds of each sensor: rate, gaps, clock."""

from collections.abc import Iterator, Mapping

import msgspec
import numpy as np

from messages import topics
from tools.review.recorded import SensorColumns, digits
from tools.review.section import ReviewSection, paragraph, table

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
    repeated: int  # samples with the same values as the one before; of IMU and pressure
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
    values = columns.values
    same = np.all(values[1:] == values[:-1], axis=1) if values.shape[1] else np.empty(0)
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
        repeated=int(np.count_nonzero(same)),
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
    if stream.repeated > stream.samples / 10:
        said.append(f"{stream.repeated / stream.samples:.0%} repeat the values before")
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
