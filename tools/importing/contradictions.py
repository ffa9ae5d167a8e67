"""What the sensors of a log say of each other and of gravity, where a map's wrong axes and units
show: pure."""

from collections.abc import Sequence
from math import cos, sqrt

import numpy as np
from numpy.typing import NDArray

from messages.units import Ns, Vec3
from services.marine.mounting import Rotation
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from tools.importing.map_file import TakenMessage
from tools.importing.quantities import TYPICAL, UNITS

WINDOW_NS = 500_000_000  # [ns] of which means are compared
WINDOWS = 20  # fewer tell no ratio
UPRIGHT_WINDOWS = 4  # fewer tell no mean gravity
SAME = 0.7  # [-] correlation from which two series are of the same movement
FAR = 8.0  # times; in the middle, by logarithm, between 1 and the degrees of a radian
ABOUT_GRAVITY = 0.3  # [-] share by which a mean specific force may be off
UPSIDE_DOWN = 0.5  # [-] share of it along down: tilted by more than 120°
HARDLY_EVER = 0.05  # [-] share of the log
DENSITY = 1000.0  # [kg/m³] of water
NEAR_NS = 500_000_000  # [ns] between three samples of pressure; longer, waves bend it
BENDS = 100  # fewer tell no noise
NOISIEST = 1000.0  # [Pa] a middle bend; a sensor of 1000 m has 300
NO_WATER = 20_000.0  # [Pa] a middle bend that not even a broken sensor has
STILL_S, STILL = 10.0, 1.0  # [s], [Pa] in so long the noise alone has a wider range

Series = dict[int, NDArray[np.float64]]  # by number of the window


class WindowMeans:
    """Means of some numbers over windows of the log."""

    def __init__(self) -> None:
        self._sums: dict[int, tuple[int, list[float]]] = {}

    def tell(self, at: Ns, values: Sequence[float]) -> None:
        number = at // WINDOW_NS
        count, sums = self._sums.get(number, (0, [0.0] * len(values)))
        added = [one + other for one, other in zip(sums, values, strict=True)]
        self._sums[number] = count + 1, added

    def series(self) -> Series:
        return {number: np.array(sums) / count for number, (count, sums) in self._sums.items()}


class SensorsHeard:
    """IMU and pressure of a log, by the vehicle's axes."""

    def __init__(self, mounted: Rotation) -> None:
        """
        Args:
            mounted: the IMU's axes to the body's.
        """
        self._mounted = np.array(mounted)
        self._force, self._rate, self._pressure = WindowMeans(), WindowMeans(), WindowMeans()
        self._own_down = WindowMeans()  # [-] share of down along the body's own
        self._last: list[tuple[Ns, float]] = []  # two pressures
        self._bends: list[float] = []  # [Pa] of three pressures, the middle one off the line
        self._range = (float("inf"), -float("inf"), 0, 0)  # [Pa] [Pa] least, most; [ns] first, last

    def imu(self, at: Ns, specific_force: Vec3, angular_rate: Vec3) -> None:
        """[m/s²], [rad/s], FRD by the map."""
        self._force.tell(at, specific_force)
        self._rate.tell(at, angular_rate)

    def own_angles(self, at: Ns, roll: float, pitch: float) -> None:
        """[rad] Of the vehicle's own estimate."""
        self._own_down.tell(at, (cos(roll) * cos(pitch),))

    def pressure(self, at: Ns, pascal: float) -> None:
        self._pressure.tell(at, (pascal,))
        if len(self._last) == 2:
            (first, one), (_, two) = self._last
            if at - first <= NEAR_NS:
                self._bends.append(abs(pascal - 2.0 * two + one))
            del self._last[0]
        self._last.append((at, pascal))
        least, most, first, _ = self._range
        self._range = min(least, pascal), max(most, pascal), first or at, at

    def upside_down(self) -> bool:
        """Does gravity point up in the mean of the log, and hardly ever down? A vehicle that really
        rolls over was upright before, or says so itself."""
        own = [*self._own_down.series().values()]
        if own and float(np.mean(own)) < -UPSIDE_DOWN:
            return False
        if len(force := [*self._body(self._force).values()]) < UPRIGHT_WINDOWS:
            return False
        mean = np.mean(force, axis=0)
        size = float(np.linalg.norm(mean))
        is_gravity = abs(size / GRAVITY - 1.0) < ABOUT_GRAVITY
        upright = float(np.mean([f[2] < -UPSIDE_DOWN * np.linalg.norm(f) for f in force]))
        return is_gravity and float(mean[2]) > UPSIDE_DOWN * size and upright < HARDLY_EVER

    def turn_ratio(self) -> float | None:
        """Times what the gyroscope says, gravity turns in the body; None: it does not tell."""
        seconds = WINDOW_NS / 1e9
        down = {k: f / np.linalg.norm(f) for k, f in self._body(self._force).items() if f.any()}
        rate = self._body(self._rate)
        turned, said = Series(), Series()
        for k, here in down.items():
            if {k - 1, k + 1} <= {*down}:
                turned[k] = down[k + 1] - down[k - 1]
                turn = (rate[k - 1] + 2.0 * rate[k] + rate[k + 1]) * seconds / 2.0
                said[k] = -np.cross(turn, here)
        return ratio(turned, said)

    def pressure_noise(self) -> float | None:
        """[Pa] Where it is too large for a sensor, the middle bend of three samples; None: it is
        not."""
        noise = float(np.median(self._bends)) if len(self._bends) >= BENDS else 0.0
        return noise if noise > NOISIEST else None

    def mean_pressure(self) -> float:
        """[Pa] As the map has it."""
        return float(np.mean([p[0] for p in self._pressure.series().values()]))

    def pressure_range(self) -> float | None:
        """[Pa] Where it is too small for a sensor that lives, that of the log; None: it is not."""
        least, most, first, last = self._range
        still = (last - first) / 1e9 > STILL_S and 0.0 < most - least < STILL
        return most - least if still else None

    def references(self) -> dict[str, Series]:
        """What gravity, gyroscope and pressure say of an estimate's fields [SI]."""
        force = self._body(self._force)
        metres = {k: p / (DENSITY * GRAVITY) for k, p in self._pressure.series().items()}
        return {
            "roll": {k: np.arctan2(-f[1:2], -f[2:3]) for k, f in force.items()},
            "pitch": {k: np.arctan2(f[:1], np.linalg.norm(f[1:])) for k, f in force.items()},
            "angular_rate": self._body(self._rate),
            "depth": metres,
            "depth_rate": {
                k: (metres[k + 1] - metres[k - 1]) * 1e9 / (2 * WINDOW_NS)
                for k in metres
                if {k - 1, k + 1} <= {*metres}
            },
        }

    def _body(self, means: WindowMeans) -> Series:
        return {k: self._mounted @ v for k, v in means.series().items()}


def ratio(said: Series, reference: Series) -> float | None:
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


def is_far(times: float | None) -> bool:
    return times is not None and not 1.0 / FAR < times < FAR


def require_upright(taken: TakenMessage, sensors: SensorsHeard) -> None:
    """
    Raises:
        LindyError: the IMU's axes are the wrong way up.
    """
    if sensors.upside_down():
        axes = taken.axes
        other = {"FRD": 'axes = "FLU"', "FLU": 'axes = "FRD"'}.get(str(axes))
        raise LindyError(
            f"{taken.where}: gravity points the wrong way, up instead of down, in the "
            f"mean of the log; write {other or 'axes with two rows of the other sign'} in the "
            f"map, or its mounting in the vehicle file"
        )


def require_turns(taken: TakenMessage, sensors: SensorsHeard) -> None:
    """
    Raises:
        LindyError: gravity turns by another unit than the gyroscope.
    """
    times = sensors.turn_ratio()
    if times is None or not is_far(times):
        return
    unit, units = taken.fields["angular_rate"].unit, UNITS["angular rate"]
    fitting = [
        f'unit = "{other}"'
        for other, factor in units.items()
        if not is_far(times * units.get(unit, 1.0) / factor)
    ]
    raise LindyError(
        f"{taken.where}: gravity turns {times:.2g} times as fast as its angular_rate "
        f"says; write {' or '.join(fitting) or 'another unit'} there in the map"
    )


def require_pressure(taken: TakenMessage, sensors: SensorsHeard) -> None:
    """
    Raises:
        LindyError: pressure moves as in no water. A noise that no other unit explains is a noisy
            sensor's.
    """
    field = taken.fields["pressure"]
    noise, span = sensors.pressure_noise(), sensors.pressure_range()
    if noise is None and span is None:
        return
    units = UNITS["pressure"]
    now = units.get(field.unit, 1.0)
    if noise is not None:
        least, most = TYPICAL["pressure"]
        said = f"jumps by {noise:.0f} Pa from sample to sample"
        fitting = [
            u
            for u, of in units.items()
            if STILL < noise * of / now < NOISIEST
            and (field.zero or least < sensors.mean_pressure() * of / now < most)
        ]
        if not fitting and noise < NO_WATER:
            return
    else:
        said = f"stays within {span:.2g} Pa all the time"
        fitting = [u for u, of in units.items() if of > now]
    remedy = " or ".join(f'unit = "{u}"' for u in fitting) or "another field"
    raise LindyError(
        f"{taken.where}: pressure {said}, which no sensor in water does; write "
        f"{remedy} there in the map"
        f"{', and zero in that unit' if field.zero else ''}"
    )
