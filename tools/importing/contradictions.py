"""What is odd in a log, counted with the first time and the worst of each; and what its sensors
say of each other and of gravity, where a map's wrong axes and units show: pure."""

from collections.abc import Sequence
from math import cos, sqrt

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from messages import topics
from messages.units import Ns
from services.marine.mounting import Rotation
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from tools.importing.map_file import QUANTITIES, STAMP_UNITS, remedy
from tools.importing.streams import Floats, LogStream, pace

SHORTEST_GAP_S = 0.25  # [s] less is jitter
GAP_PERIODS = 10  # a pause of so many usual periods is a gap
LEARNT = 50  # periods from which the usual one is taken


class Oddity(msgspec.Struct, kw_only=True):
    """One kind of oddity in one of our streams."""

    stream: str
    what: str
    count: int = 0
    first_s: float  # [s] since the log began
    most: float | None = None  # of the worst, in the unit that `what` says

    @property
    def in_words(self) -> str:
        """`sensor/imu: gap: 3, the first at 12.4 s, the worst 0.8 s`"""
        before, _, unit = self.what.partition(" [")
        unit, _, after = unit.partition("]")
        times = f"{self.count}, the first at {self.first_s:.1f} s"
        worst = f", the worst {self.most:g} {unit}".rstrip() if self.most else ""
        return f"{self.stream}: {before}{after}: {times}{worst}"


class Oddities:
    """Counts what is told."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], Oddity] = {}

    def tell(self, stream: str, what: str, at_s: ArrayLike, sizes: ArrayLike = ()) -> None:
        """
        Args:
            at_s: (n,) [s] since the log began.
            sizes: (n,) how bad, in the unit that `what` says; empty: that is not told.
        """
        times = np.atleast_1d(np.asarray(at_s, float))
        if not len(times):
            return
        first = round(float(times.min()), 3)
        odd = self._found.setdefault(
            (stream, what), Oddity(stream=stream, what=what, first_s=first)
        )
        odd.count += len(times)
        odd.first_s = min(odd.first_s, first)
        if np.size(sizes):
            odd.most = round(max(float(np.max(sizes)), odd.most or 0.0), 3)

    def all(self) -> list[Oddity]:
        return sorted(self._found.values(), key=lambda odd: (odd.stream, odd.what))


def gaps(stamps: Sequence[Ns]) -> tuple[NDArray[np.int64], Floats]:
    """Places in a stream behind pauses that are much longer than its usual period, and their [s]:
    of the first samples, until that period is known, than those so far."""
    periods = np.diff(np.asarray(stamps, np.int64)) / 1e9
    so_far = [float(np.median(periods[: k + 1])) for k in range(min(LEARNT, len(periods)))]
    usual = np.array([*so_far, *so_far[-1:] * (len(periods) - len(so_far))])
    places = np.flatnonzero(periods > np.maximum(SHORTEST_GAP_S, GAP_PERIODS * usual))
    return places + 1, periods[places]


WINDOW_NS = 500_000_000  # [ns] of which means are compared
WINDOWS = 20  # fewer tell no ratio
UPRIGHT_WINDOWS = 4  # fewer tell no mean gravity
SAME = 0.7  # [-] correlation from which two series are of the same movement
FAR = 8.0  # times; in the middle, by logarithm, between 1 and the degrees of a radian
PACE = 2.0  # times by which a board's clock may be off
ABOUT_GRAVITY = 0.3  # [-] share by which a mean specific force may be off
UPSIDE_DOWN = 0.5  # [-] share of it along down: tilted by more than 120°
HARDLY_EVER = 0.05  # [-] share of the log
DENSITY = 1000.0  # [kg/m³] of water
NEAR_NS = 500_000_000  # [ns] between three samples of pressure; longer, waves bend it
BENDS = 100  # fewer tell no noise
NOISIEST = 1000.0  # [Pa] a middle bend; a sensor of 1000 m has 300
NO_WATER = 20_000.0  # [Pa] a middle bend that not even a broken sensor has
STILL_S, STILL = 10.0, 1.0  # [s], [Pa] in so long the noise alone has a wider range

Series = dict[int, Floats]  # means (k,) by number of the window


def unbelieved(stream: LogStream, sensors: "SensorsHeard") -> dict[str, str]:
    """Fields of an estimate that contradict the sensors, and why, in words.

    Raises:
        LindyError: the map's units or axes contradict what the log's sensors say of each other.
    """
    if stream.taken.clock == "board":
        _require_pace(stream)
    match stream.topic.key:
        case topics.IMU.key:
            _require_upright(stream, sensors)
            _require_turns(stream, sensors)
        case topics.PRESSURE.key:
            _require_pressure(stream, sensors)
        case topics.ESTIMATE.key:
            return _left_out(stream, sensors.references())
        case _:
            pass
    return {}


def _left_out(stream: LogStream, references: dict[str, Series]) -> dict[str, str]:
    """What contradicts, and angles that are in its unit."""
    found: dict[str, str] = {}
    fields, angles = stream.taken.fields, ("roll", "pitch", "heading")
    for name in fields:
        if name not in references:
            continue
        times = _ratio(means(*_readable(stream, name)), references[name])
        if times is None or not _is_far(times):
            continue
        unit = fields[name].unit
        words = f"{name} is {times:.2g} times what the sensors say in the map's {unit}, left out"
        found.setdefault(name, words)
        for other in angles if name in angles else ():
            if other in fields and fields[other].unit == unit:
                found.setdefault(other, f"{other}, as {words}")
    return found


class SensorsHeard:
    """IMU, pressure and attitude of a log, by the vehicle's axes."""

    def __init__(self, streams: Sequence[LogStream], mounted: Rotation) -> None:
        """
        Args:
            mounted: the IMU's axes to the body's.
        """
        self.force, self.rate = Series(), Series()  # [m/s²], [rad/s]
        self.own_down = np.zeros(0)  # [-] share of down along the body's own, by its estimate
        self.pressure = Series()  # [Pa]
        self.noise: float | None = None  # [Pa] where it is too large: a middle bend of 3 samples
        self.still: float | None = None  # [Pa] where it is too small: the range of the log
        for stream in streams:
            if stream.topic.key == topics.IMU.key:
                both = _readable(stream, "specific_force", "angular_rate")
                self.force, self.rate = (
                    {k: np.array(mounted) @ v for k, v in means(both[0], values).items()}
                    for values in (both[1][:, :3], both[1][:, 3:])
                )
            elif stream.topic.key == topics.PRESSURE.key:
                self._hear_pressure(*_readable(stream, "pressure"))
            elif stream.topic.key == topics.ESTIMATE.key:
                down = means(*_own_down(stream))
                self.own_down = np.append(self.own_down, [*down.values()])

    def _hear_pressure(self, at: NDArray[np.int64], column: Floats) -> None:
        self.pressure, pascal = means(at, column), column[:, 0]
        near = at[2:] - at[:-2] <= NEAR_NS
        bends = np.abs(pascal[2:] - 2.0 * pascal[1:-1] + pascal[:-2])[near]
        noise = float(np.median(bends)) if len(bends) >= BENDS else 0.0
        self.noise = noise if noise > NOISIEST else None
        if len(at) and (at[-1] - at[0]) / 1e9 > STILL_S and 0.0 < np.ptp(pascal) < STILL:
            self.still = float(np.ptp(pascal))

    def upside_down(self) -> bool:
        """Does gravity point up in the mean of the log, and hardly ever down? A vehicle that really
        rolls over was upright before, or says so itself."""
        if len(self.own_down) and float(np.mean(self.own_down)) < -UPSIDE_DOWN:
            return False
        if len(self.force) < UPRIGHT_WINDOWS:
            return False
        force = np.array([*self.force.values()])
        mean = np.mean(force, axis=0)
        size = float(np.linalg.norm(mean))
        is_upright = force[:, 2] < -UPSIDE_DOWN * np.linalg.norm(force, axis=1)
        upright = np.count_nonzero(is_upright) / len(force)
        if abs(size / GRAVITY - 1.0) > ABOUT_GRAVITY or upright >= HARDLY_EVER:
            return False
        return float(mean[2]) > UPSIDE_DOWN * size

    def turn_ratio(self) -> float | None:
        """Times what the gyroscope says, gravity turns in the body; None: it does not tell."""
        seconds = WINDOW_NS / 1e9
        down = {k: f / np.linalg.norm(f) for k, f in self.force.items() if f.any()}
        turned, said = Series(), Series()
        for k, here in down.items():
            if {k - 1, k + 1} <= {*down}:
                turned[k] = down[k + 1] - down[k - 1]
                rates = self.rate[k - 1] + 2.0 * self.rate[k] + self.rate[k + 1]
                said[k] = -np.cross(rates * seconds / 2.0, here)
        return _ratio(turned, said)

    def references(self) -> dict[str, Series]:
        """What gravity, gyroscope and pressure say of an estimate's fields [SI]."""
        metres = {k: p / (DENSITY * GRAVITY) for k, p in self.pressure.items()}
        force = self.force.items()
        return {
            "roll": {k: np.arctan2(-f[1:2], -f[2:3]) for k, f in force},
            "pitch": {k: np.arctan2(f[:1], np.linalg.norm(f[1:])) for k, f in force},
            "angular_rate": self.rate,
            "depth": metres,
            "depth_rate": {
                k: (metres[k + 1] - metres[k - 1]) * 1e9 / (2 * WINDOW_NS)
                for k in metres
                if {k - 1, k + 1} <= {*metres}
            },
        }


def _readable(stream: LogStream, *names: str) -> tuple[NDArray[np.int64], Floats]:
    """(n,) [ns] UTC and (n, k) [SI, FRD] the rows that have numbers in all these fields, which are
    not along a curve."""
    at = np.frombuffer(stream.arrivals, np.int64)
    whole = np.all([stream.is_there(name) for name in names], axis=0)
    values = np.column_stack([stream.column(name) for name in names])
    whole &= np.isfinite(values).all(axis=1)
    whole &= not any(stream.taken.fields[name].curve for name in names)
    return at[whole], values[whole]


def _own_down(stream: LogStream) -> tuple[NDArray[np.int64], Floats]:
    if "attitude" in stream.taken.fields:
        at, attitudes = _readable(stream, "attitude")
        angles = [stream.angles((w, x, y, z))[:2] for w, x, y, z in attitudes.tolist()]
    elif {"roll", "pitch"} <= {*stream.taken.fields}:
        at, both = _readable(stream, "roll", "pitch")
        angles = both.tolist()
    else:
        return np.zeros(0, np.int64), np.zeros((0, 1))
    return at, np.array([[cos(roll) * cos(pitch)] for roll, pitch in angles]).reshape(-1, 1)


def means(at: NDArray[np.int64], values: Floats) -> Series:
    """Over windows of the log."""
    windows, of = np.unique(at // WINDOW_NS, return_inverse=True)
    count = np.bincount(of)
    sums = [np.bincount(of, column) for column in values.T]
    return dict(zip(windows.tolist(), np.column_stack(sums) / count[:, None], strict=True))


def _ratio(said: Series, reference: Series) -> float | None:
    """How many times the reference's movement the other says; None: too short, or they do not move
    alike."""
    both = sorted({*said} & {*reference})
    if len(both) < WINDOWS:
        return None
    a, b = (np.array([series[k] for k in both]) for series in (said, reference))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    sizes = sqrt(float(np.sum(a * a)) * float(np.sum(b * b)))
    if sizes == 0.0 or float(np.sum(a * b)) < SAME * sizes:
        return None
    return sqrt(float(np.sum(a * a)) / float(np.sum(b * b)))


def _is_far(times: float) -> bool:
    return not 1.0 / FAR < times < FAR


def _require_pace(stream: LogStream) -> None:
    found, unit = pace(stream.stamps, stream.arrivals), stream.taken.stamp_unit
    if found is None or 1.0 / PACE < found < PACE:
        return
    scale = STAMP_UNITS[unit]
    fitting = (
        other
        for other, of in STAMP_UNITS.items()
        if {unit, other}.isdisjoint({"ros", "date"}) and 1.0 / PACE < found * of / scale < PACE
    )
    how = remedy("stamp_unit", fitting, 'clock = "arrival"')
    raise LindyError(
        f"{stream.taken.where}: its stamps ({stream.taken.stamp}) go by {found:.3g} s in a second "
        f"of the log; write {how} in the map"
    )


def _require_upright(stream: LogStream, sensors: SensorsHeard) -> None:
    if sensors.upside_down():
        axes = str(stream.taken.axes)
        other = {"FRD": 'axes = "FLU"', "FLU": 'axes = "FRD"'}.get(axes)
        raise LindyError(
            f"{stream.taken.where}: gravity points the wrong way, up instead of down, in the "
            f"mean of the log; write {other or 'axes with two rows of the other sign'} in the "
            f"map, or its mounting in the vehicle file"
        )


def _require_turns(stream: LogStream, sensors: SensorsHeard) -> None:
    """Gravity must turn by the unit of the gyroscope."""
    times = sensors.turn_ratio()
    if times is None or not _is_far(times):
        return
    units = QUANTITIES["angular rate"].units
    now = units.get(stream.taken.fields["angular_rate"].unit, 1.0)
    fitting = (unit for unit, of in units.items() if not _is_far(times * now / of))
    raise LindyError(
        f"{stream.taken.where}: gravity turns {times:.2g} times as fast as its angular_rate "
        f"says; write {remedy('unit', fitting, 'another unit')} there in the map"
    )


def _require_pressure(stream: LogStream, sensors: SensorsHeard) -> None:
    """It must move as in water. A noise that no other unit explains is a noisy sensor's."""
    field, noise, still = stream.taken.fields["pressure"], sensors.noise, sensors.still
    units = QUANTITIES["pressure"].units
    now = units.get(field.unit, 1.0)
    if noise is not None:
        least, most = QUANTITIES["pressure"].typical
        mean = float(np.mean([*sensors.pressure.values()]))  # [Pa] as the map has it
        said = f"jumps by {noise:.0f} Pa from sample to sample"
        fitting = [
            unit
            for unit, of in units.items()
            if STILL < noise * of / now < NOISIEST
            and (field.zero or least < mean * of / now < most)
        ]
        if not fitting and noise < NO_WATER:
            return
    elif still is not None:
        said = f"stays within {still:.2g} Pa all the time"
        fitting = [unit for unit, of in units.items() if of > now]
    else:
        return
    raise LindyError(
        f"{stream.taken.where}: pressure {said}, which no sensor in water does; write "
        f"{remedy('unit', fitting, 'another field')} there in the map"
        f"{', and zero in that unit' if field.zero else ''}"
    )
