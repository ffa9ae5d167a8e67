"""The verb `lindy identify`: from a recording to the numbers of the vehicle, and how well they
predict another dive."""

import sys
from math import exp, log, sqrt
from pathlib import Path
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
from cyclopts import App, Parameter

from services.marine.vehicle import Vehicle, driven, first_order
from services.reference.settings import Settings
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.choices import Overrides, VehicleName, named
from tools.fresh import refuse_existing, write_fresh
from tools.identify import motion_model
from tools.identify import plan as planning
from tools.identify.dive_data import (
    NO_SAMPLES,
    WINDOW_S,
    DiveData,
    busiest,
    fit_input,
    read,
    windows,
)
from tools.identify.fit import Fit, fit
from tools.identify.motion_model import (
    AXES,
    LAG,
    Beginning,
    Floats,
    Measured,
    coefficients,
    lagged,
    predict,
    start_of,
)
from tools.identify.results import (
    VehicleFile,
    as_table,
    identified,
    of_recording,
    remarks,
    rewritten,
    rounded,
    rows,
    weakly,
)
from tools.recordings.recording import open_recording

LAG_STEP = 1e-4  # [-] of a difference quotient in the logarithm
LAG_STEPS = 12
MOST_LAG_STEP = 0.5
LEAST_LAG_STD = 1e-3  # [-] of the lag: a simulated thrust has no noise, and no lag is that exact


class MeasuredLag(NamedTuple):
    seconds: float
    std: float  # [s]


def measured_lag(data: DiveData, vehicle: Vehicle) -> MeasuredLag | None:
    """One lag for all thrusters, by Gauss-Newton; None: no thrust changed, or not as a first-order
    lag does."""
    pairs = list(zip(vehicle.thruster, data.commands.T, strict=True))
    settles = np.array([[driven(t, newtons) for newtons in row.tolist()] for t, row in pairs]).T
    inside = (data.thrust_t >= data.command_t[0]) & (data.thrust_t <= data.command_t[-1])
    at, measured = data.thrust_t[inside], data.thrust[inside]

    def expected(x: float) -> Floats:
        return lagged(data.command_t, settles, first_order(exp(x)), at).value

    information = 0.0
    x = log(float(np.median([thruster.time_constant for thruster in vehicle.thruster])))
    for _ in range(LAG_STEPS):
        here = expected(x)
        slope, left = (expected(x + LAG_STEP) - here) / LAG_STEP, measured - here
        information = float(np.sum(slope**2))
        if not information > 0.0:
            return None
        x += max(-MOST_LAG_STEP, min(MOST_LAG_STEP, float(np.sum(slope * left)) / information))
        if not log(1e-4) < x < log(10.0):
            return None
    left = measured - expected(x)
    std = max(LEAST_LAG_STD, sqrt(float(np.mean(left**2)) / information))
    return MeasuredLag(exp(x), exp(x) * std)


FEWEST_WINDOWS = 2
HOW = "fly the manoeuvres of `lindy identify plan`"


class Identified(NamedTuple):
    file: VehicleFile
    start: Beginning
    fit: Fit


def identify_dive(
    recording: Path,
    vehicle: str | None = None,
    axes: tuple[str, ...] = AXES,
) -> Identified:
    """
    Args:
        vehicle: file to begin from; None: that of the recording.

    Raises:
        LindyError: there is no such recording, or it does not tell enough of any axis.
    """
    opened = open_recording(recording)
    file = of_recording(opened, vehicle)
    data, start = read(opened, file.vehicle, file.water, recording), start_of(file.vehicle)
    found = windows(data, file.vehicle)
    if len(found.t) < FEWEST_WINDOWS:
        most, times = max(found.refused.items(), key=lambda item: item[1])
        raise LindyError(
            f"{recording} {NO_SAMPLES}: {len(found.t)} stretches of {WINDOW_S:g} s can be used, "
            f"expected at least {FEWEST_WINDOWS}; {times * found.period:.0f} s: {most}"
        )
    result = fit(busiest(fit_input(data, found, file.vehicle, file.wake_share)), start, axes)
    if not result.axes:
        told = [f"{axis}: {weakly(*result.refused[axis])}" for axis in axes]
        raise LindyError(f"{recording} does not excite any axis enough; {'; '.join(told)}; {HOW}")
    if len(data.thrust) and (lag := measured_lag(data, file.vehicle)) is not None:
        result.x[LAG] = log(lag.seconds)
        result.covariance[LAG] = result.covariance[:, LAG] = 0.0
        result.covariance[LAG, LAG] = (lag.std / lag.seconds) ** 2
        no_curve = all(thruster.lag is None for thruster in file.vehicle.thruster)
        result = result._replace(lag=no_curve)
    return Identified(file, start, result)


def read_dive(recording: Path, file: VehicleFile) -> DiveData:
    """Another dive of the same vehicle."""
    return read(open_recording(recording), file.vehicle, file.water, recording)


AHEAD_S = 60.0, 20.0  # [s] the first of which the dive holds a stretch


class PredictionError(NamedTuple):
    """Root mean square over all stretches."""

    depth_rate: float  # [m/s]
    yaw_rate: float  # [rad/s]


class Comparison(NamedTuple):
    stretches: int
    seconds: float  # of each
    before: PredictionError  # of the vehicle file
    after: PredictionError  # of the identified vehicle


def compare(
    data: DiveData, before: Vehicle, after: Vehicle, wake_share: float, name: Path
) -> Comparison:
    """
    Raises:
        LindyError: the dive has no such stretch.
    """
    ahead = AHEAD_S[0]
    if not len((found := windows(data, before, ahead)).t):
        ahead = AHEAD_S[1]
        found = windows(data, before, ahead)
    if not len(found.t):
        raise LindyError(
            f"{name} has no {ahead:g} s in which the drone is armed, under water, and no thruster "
            f"is at its limit"
        )
    n = found.t.shape[1]
    depth_rate = np.interp(found.t, data.state_t, data.state[:, 3])

    def error(vehicle: Vehicle) -> PredictionError:
        taken = fit_input(data, found, vehicle, wake_share)
        measured = Measured(
            found.period, taken.wrench[None], taken.mean[None], found.rates[..., :2],
            found.down[None],
        )  # fmt: skip
        motion = predict(coefficients([vehicle], wake_share), found.begin[None], measured)
        sinking = np.sum(motion.velocity[0, :, :, :3] * found.down[:, :n], axis=-1)
        return PredictionError(
            _rms(sinking - depth_rate), _rms(motion.velocity[0, ..., 3] - found.rates[..., 2])
        )

    return Comparison(len(found.t), ahead, error(before), error(after))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


identify = App(name="identify", help="Find inertia, drag, buoyancy and lag in a dive.")

AxesOption = Annotated[
    str, Parameter(help="heave, yaw, surge and sway, or some of them, by commas")
]
VehicleOption = Annotated[
    str | None, Parameter(help="file to begin from; default: that in the recording")
]


@identify.command(name="plan")
def plan_(
    *,
    out: Annotated[Path, Parameter(converter=named, help="the stick log to write, a new file")],
    vehicle: VehicleName = "pioneer",
    axes: AxesOption = "heave,yaw",
    depth: Annotated[float, Parameter(help="[m] in the middle of the manoeuvres")] = 3.0,
    strength: Annotated[float, Parameter(help="0.1 … 1 of full stick")] = 1.0,
    set_: Overrides = (),
) -> int:
    """Write the manoeuvres that make a vehicle's numbers visible, as a stick log to be flown.

    Says how much water and time they need. While they are flown, STOP works as in every dive.

    Example: lindy identify plan --vehicle pioneer --out sticks.csv
             lindy dive --pilot script:sticks.csv --out dives/identify
             lindy identify dives/identify --out mine.toml
    """
    if not 0.1 <= strength <= 1.0:
        raise LindyError(f"--strength is {strength:g}, expected 0.1 to 1")
    if not 0.0 < depth <= 1000.0:
        raise LindyError(f"--depth is {depth:g}, expected more than 0, at most 1000 m")
    stack = Stack(vehicle=vehicle, overrides=list(set_))
    hull = stack.section("vehicle", Vehicle)
    wanted = cast(Any, _axes(axes, planning.AXES))
    found = planning.plan(hull, stack.section("reference", Settings), wanted, depth, strength)
    write_fresh(out, planning.as_csv(found, hull).encode())
    print(f"{out}: {planning.told(found)}")
    return 0


@identify.default
def recording_(
    recording: Path,
    /,
    *,
    out: Annotated[
        Path | None, Parameter(converter=named, help="a new vehicle file with the fitted numbers")
    ] = None,
    axes: AxesOption = "heave,yaw,surge,sway",
    vehicle: VehicleOption = None,
    check: Annotated[
        Path | None, Parameter(help="another dive, which both vehicle files predict")
    ] = None,
) -> int:
    """Fit a vehicle's numbers to a recorded dive, with their deviations.

    RECORDING is a dive's folder or its MCAP file. An axis that the dive does not tell enough of
    keeps the numbers of the vehicle file.

    Example: lindy identify dives/latest --out mine.toml --check dives/other
    """
    if out is not None:
        refuse_existing(out)
    if sys.stderr.isatty():
        print("lindy: reads and fits, which may take minutes", file=sys.stderr, flush=True)
    found = identify_dive(recording, vehicle, _axes(axes, motion_model.AXES))
    exact = identified(found.fit, found.start)
    notes = remarks(found.fit, exact)
    new = rounded(exact)
    compared = None
    if check is not None:
        other = read_dive(check, found.file)
        compared = compare(other, found.file.vehicle, new, found.file.wake_share, check)
    if out is not None:
        why = f"identified from {recording.resolve().name}"
        write_fresh(out, rewritten(found.file, new, why).encode())
    print("\n".join([*as_table(rows(found.fit, found.start)), "", *notes]))
    if compared is not None:
        before, after = compared.before, compared.after
        print(
            f"\n{check}, {compared.stretches} times {compared.seconds:g} s predicted: depth rate "
            f"to {after.depth_rate:.3g} m/s, {after.depth_rate / before.depth_rate:.2f} times "
            f"the error of {found.file.name}; yaw rate to {after.yaw_rate:.3g} rad/s, "
            f"{after.yaw_rate / before.yaw_rate:.2f} times"
        )
    return 0


def _axes(text: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """
    Raises:
        LindyError: a name is not known, or there twice.
    """
    names = tuple(name.strip() for name in text.split(","))
    if not set(names) <= set(known) or len(set(names)) < len(names):
        raise LindyError(f"--axes {text}: expected some of {','.join(known)}, each once")
    return names
