"""The fit: the vehicle whose open-loop motion, from the recorded commands, is nearest to what the
sensors measured.

Output error (Ljung 1999, §7.3): every window is predicted from its begin by thrust alone, and
compared with the specific force, the yaw rate and the depth. What belongs to a window alone is
eliminated: its velocities at the begin, offset and drift of the accelerometers (with tilt, which
reads as surge and sway acceleration), offset of the yaw gyroscope, and of the depth. The weights of
the sensors come from the residuals.
"""

from typing import NamedTuple

import numpy as np

from services.control.allocation.layout import effect_matrix
from services.marine.vehicle import GRAVITY, Vehicle
from tools.identify.dive_data import DiveData, Windows, columns_at, times
from tools.identify.least_squares import (
    Eliminated,
    WindowEquations,
    covariance,
    damped_step,
    eliminate,
    normal_equations,
    own_step,
)
from tools.identify.motion_model import ROWS, Measured, Predicted, coefficients, predict
from tools.identify.parameters import (
    AXES,
    BUOYANCY,
    COUNT,
    LAG,
    Beginning,
    indices_of,
    inertia_of,
    linear_of,
    quadratic_of,
    vehicle_of,
)
from tools.identify.thrust import CommandedThrust, Floats

STEP = 1e-4  # [-], [m/s], [rad] of a difference quotient
# [m/s, rad/s, rad] of the estimate at a window's begin; the tilt's is the accelerometers' bias.
BEGIN_STD = np.array([0.15, 0.15, 0.1, 0.05, 0.03, 0.03])
COARSE = 0.05  # [-] of these deviations, at first
YAW, DEPTH, CHANNELS = 3, 4, 5  # channels: three forces, yaw rate, depth
OWN = 6  # unknowns of a window that change its motion: velocities and tilt at its begin
COLUMNS = 1 + COUNT + OWN  # here, and a step in each
KNOT_S = 2.0  # [s] between changes of the tilt by the gyroscopes' noise
FIRST_STD = np.array([0.03, 0.03, 0.03, 0.003, 0.05])  # [m/s², rad/s, m] before residuals are known
LEAST_STD = 1e-8  # [m/s², rad/s, m]
BLOCK_S = 1.0  # [s] longer than the residuals' memory
ROUNDS = 3  # of weights from residuals
MOST_STEPS = 15
SMALL_DAMPING = 1e-2  # [-] a step damped more says nothing about the gain to be had
SMALL_GAIN = 1e-3  # [-] of the sum of squares, in units of the noise: the end of a round
RETRIES = 3
WHITE = 1.5  # [-] deviations enlarged by less: the residuals are white
NOT_EXPLAINED = 3.0  # [-] times the median residual of the windows: something else pushed there
UNTOLD = 1e-4  # [-] 1/σ of what is fitted, so that the equations are never singular
FIXED = 1e6  # [-] 1/σ of what is held
MOST_INERTIA_STD = 0.1  # [-] an axis that the data tell less of is not fitted
MOST_DRAG_STD = 0.3  # [-] of the drag at the typical speed
MOST_LAG_STD = 0.5  # [-]
NOT_MOVED = np.inf, np.inf  # in place of deviations
LEAST_SPEED = 0.15  # [m/s, rad/s] typical of an axis that was moved on purpose
MOST_WINDOWS = 40  # those with most thrust; more hardly make it better


class FitInput(NamedTuple):
    """The data of a fit, and how they are taken."""

    windows: Windows
    thrust: CommandedThrust | None  # None: as measured, in `wrench`
    wrench: Floats  # (windows, n, 4) [N, N m] by the vehicle file's lag, or measured
    mean: Floats  # (windows, n / 2, 4) [N, N m] over each step of the model
    wander: float  # [rad/√s] of the tilt, by the gyroscopes' noise
    wake_share: float
    fits_lag: bool


class Fit(NamedTuple):
    x: Floats  # (COUNT,) see parameters.py
    covariance: Floats  # (COUNT, COUNT)
    axes: tuple[str, ...]  # that are fitted
    lag: bool  # is fitted
    speed: Floats  # (4,) [m/s, rad/s] typical of the dive
    noise: Floats  # (5,) [m/s² × 3, rad/s, m] residual std
    inflation: Floats  # (COUNT,) of the deviations, because residuals are not white
    condition: float  # [-] of the information about what is fitted, each scaled to 1
    unexplained: int  # windows left out
    used: int  # windows
    refused: dict[str, tuple[float, float]]  # axis: std of inertia and of drag [-] it would have


def fit_input(data: DiveData, found: Windows, vehicle: Vehicle, wake_share: float) -> FitInput:
    """Thrust as measured, if it is; else from the commands."""
    if len(data.thrust):
        force = data.thrust @ effect_matrix(vehicle).T[:, list(ROWS)]
        pairs = (force[1:] + force[:-1]) / 2 * np.diff(data.thrust_t)[:, None]
        integral = np.vstack([np.zeros((1, 4)), np.cumsum(pairs, axis=0)])
        steps = _step_ends(found)
        wrench = columns_at(found.t, data.thrust_t, force)
        means = np.diff(columns_at(steps, data.thrust_t, integral), axis=1) / (2 * found.period)
        return FitInput(found, None, wrench, means, data.wander, wake_share, fits_lag=False)
    thrust = CommandedThrust(vehicle, data.command_t, data.commands)
    fits_lag = all(thruster.lag is None for thruster in vehicle.thruster)
    wrench, means = _wrench(thrust, found, None)
    return FitInput(found, thrust, wrench, means, data.wander, wake_share, fits_lag)


def busiest(taken: FitInput, most: int = MOST_WINDOWS) -> FitInput:
    """Only the windows in which the wrench changes most."""
    spread = taken.wrench.std(axis=1)
    scale = np.maximum(spread.max(axis=0, initial=0.0), 1e-9)
    order = np.argsort(-(spread / scale).max(axis=1, initial=0.0), kind="stable")[:most]
    keep = np.sort(order)
    return _only(taken, [int(n) for n in keep])


def _only(taken: FitInput, keep: list[int]) -> FitInput:
    w = taken.windows
    windows = w._replace(
        t=w.t[keep], rates=w.rates[keep], force=w.force[keep], down=w.down[keep],
        tilted=w.tilted[keep],
        begin=w.begin[keep], depth_t=[w.depth_t[n] for n in keep],
        depth=[w.depth[n] for n in keep],
    )  # fmt: skip
    return taken._replace(windows=windows, wrench=taken.wrench[keep], mean=taken.mean[keep])


def fit(taken: FitInput, start: Beginning, axes: tuple[str, ...] = AXES) -> Fit:
    """The axes of these that the data tell enough of; there may be none."""
    refused: dict[str, tuple[float, float]] = {}
    lag = taken.fits_lag
    while True:
        search = _Search(taken, start, axes, lag)
        weak = search.weak(search.white)  # by the file's numbers: costs one linearisation
        if not weak:
            search.run()
            weak = search.weak(search.covariance)
        if not weak:
            return search.result(refused)
        for name, deviations in weak.items():
            refused[name] = deviations
            lag = lag and name != "lag"
            axes = tuple(axis for axis in axes if axis != name)
        if not axes:
            return search.result(refused)._replace(axes=(), lag=False)


class _Search:
    """One fit of certain axes."""

    def __init__(self, taken: FitInput, start: Beginning, axes: tuple[str, ...], lag: bool) -> None:
        self._taken, self._start = taken, start
        self._axes, self._lag = axes, lag
        self._x = start.vector
        self._prior = start.vector
        self._inverse = 1.0 / start.prior**2
        free = [index for axis in axes for index in indices_of(axis)] + ([LAG] if lag else [])
        self._inverse[free] = UNTOLD**2
        if not taken.fits_lag:
            self._inverse[LAG] = FIXED**2
        # Velocities at the begin [m/s, rad/s], and the tilt there beyond the estimate [rad].
        self._estimate: Floats = np.pad(taken.windows.begin.astype(float), ((0, 0), (0, 2)))
        self._begin: Floats = self._estimate.copy()
        self._begin_std: Floats = BEGIN_STD
        self._noise = FIRST_STD.copy()
        self._channels = list(range(CHANNELS))
        self._unexplained = 0
        self._free = free
        self._bounded: Floats | None = None  # covariance before a drag was held at zero
        self._update()

    def run(self) -> None:
        for number in range(ROUNDS):
            if number == 0:
                self._coarse()
            self._descend()
            if number == 0:
                self._leave_unexplained()
            self._weigh()
        self._descend()
        for _ in range(RETRIES):
            if not self._better():
                break
        self._hold_positive()

    def _coarse(self) -> None:
        """First only what is fitted, the rest as estimated and as in the file; then also the
        file's numbers, at last the velocities at the begin. Wrong drag could otherwise be explained
        by surge and sway, of which the wake's lift makes drag whatever their signs."""
        inverse, self._inverse = self._inverse, self._inverse.copy()
        others = np.setdiff1d(np.arange(COUNT), self._free)
        self._inverse[others] /= COARSE**2
        self._begin_std = BEGIN_STD * np.array([COARSE, COARSE, 1.0, 1.0, 1.0, 1.0])
        self._update()
        self._descend()
        self._inverse = inverse
        self._update()
        self._descend()
        self._begin_std = BEGIN_STD
        self._update()

    def _better(self) -> bool:
        """Where residuals are not white, begin again with what is fitted as found, the rest as
        estimated; keep what is better."""
        if self._inflated()[1].max() < WHITE:
            return False
        kept = self._x, self._begin, self._cost
        others = np.setdiff1d(np.arange(COUNT), self._free)
        self._x, self._begin = self._x.copy(), self._estimate.copy()
        self._x[others] = self._prior[others]
        self._coarse()
        self._descend()
        if self._cost < kept[2] - 1.0:
            self._weigh()
            self._descend()
            return True
        self._x, self._begin, _ = kept
        self._update()
        return False

    def _descend(self) -> None:
        damping = 1e-5
        for _ in range(MOST_STEPS):
            now = normal_equations(self._left, self._prior - self._x, self._inverse)
            before = self._x, self._begin, self._equations, self._left, self._base
            step = np.clip(damped_step(now, damping), -1.0, 1.0)
            share = 1.0 / (1.0 + damping)
            own = [share * own_step(window, step)[:OWN] for window in self._equations]
            self._x = self._x + step
            self._begin = self._begin + np.array(own).reshape(-1, OWN)
            self._update()
            cost = self._cost
            if not cost <= now.cost:  # NaN, too
                self._x, self._begin, self._equations, self._left, self._base = before
                damping *= 10.0
                if damping > 1e6:
                    return
                continue
            if now.cost - cost <= SMALL_GAIN and damping <= SMALL_DAMPING:
                return
            damping /= 10.0

    @property
    def _cost(self) -> float:
        return normal_equations(self._left, self._prior - self._x, self._inverse).cost

    def _hold_positive(self) -> None:
        """Drag does not drive: a coefficient that comes out negative is held at zero. Deviations
        stay those of the fit without this knowledge."""
        negative = [
            index
            for axis in range(4)
            for index in (linear_of(axis), quadratic_of(axis))
            if self._x[index] < 0.0
        ]
        if negative:
            self._bounded = self._inflated()[0]
            self._x[negative], self._prior = 0.0, self._prior.copy()
            self._prior[negative], self._inverse[negative] = 0.0, FIXED**2
            self._update()
            self._descend()
            self._x[negative] = 0.0

    def _leave_unexplained(self) -> None:
        sizes = np.array([np.sqrt(np.mean(left.residual**2)) for left in self._left])
        keep = np.flatnonzero(sizes <= NOT_EXPLAINED * np.median(sizes)).tolist()
        if len(keep) < len(sizes):
            self._unexplained += len(sizes) - len(keep)
            self._taken, self._begin = _only(self._taken, keep), self._begin[keep]
            self._estimate = self._estimate[keep]
            self._update()
            self._descend()

    def _weigh(self) -> None:
        """Set each channel's noise to what its residuals show."""
        for channel in self._channels:
            parts = [
                left.residual[rows == channel]
                for left, rows in zip(self._left, self._rows, strict=True)
            ]
            rms = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
            self._noise[channel] = max(LEAST_STD, rms * self._noise[channel])
        self._update()

    # Judgement.

    @property
    def white(self) -> Floats:
        """(COUNT, COUNT) If residuals were white."""
        return covariance(self._left, self._inverse)[0]

    @property
    def covariance(self) -> Floats:
        """(COUNT, COUNT) With the residuals as they are."""
        return self._bounded if self._bounded is not None else self._inflated()[0]

    def _inflated(self) -> tuple[Floats, Floats]:
        white, inflation = covariance(self._left, self._inverse)
        return white * np.outer(inflation, inflation), inflation

    def weak(self, cov: Floats) -> dict[str, tuple[float, float]]:
        """Axes that the data tell too little of, with the std of inertia and of drag [-]."""
        found: dict[str, tuple[float, float]] = {}
        speed = self._speed()
        for name in self._axes:
            axis = AXES.index(name)
            inertia = float(np.sqrt(cov[inertia_of(axis), inertia_of(axis)]))
            value, std = drag_at(self._start, self._x, cov, axis, float(speed[axis]))
            drag = std / value if value > 0.0 else np.inf
            if not speed[axis] >= LEAST_SPEED:
                found[name] = NOT_MOVED
            elif not (inertia <= MOST_INERTIA_STD and drag <= MOST_DRAG_STD):
                found[name] = inertia, drag
        if self._lag and not np.sqrt(cov[LAG, LAG]) <= MOST_LAG_STD:
            found["lag"] = float(np.sqrt(cov[LAG, LAG])), 0.0
        return found

    def _speed(self) -> Floats:
        """(4,) Exceeded in a twentieth of the time."""
        moving = np.abs(np.asarray(self._base.velocity[0], dtype=np.float64)).reshape(-1, 4)
        moving.sort(axis=0)
        return moving[int(0.95 * len(moving))]

    def result(self, refused: dict[str, tuple[float, float]]) -> Fit:
        return Fit(
            self._x, self.covariance, self._axes, self._lag, self._speed(), self._noise,
            self._inflated()[1], self._condition(),
            self._unexplained, len(self._taken.windows.t), refused,
        )  # fmt: skip

    def _condition(self) -> float:
        information = np.linalg.inv(self.white[np.ix_(self._free, self._free)])
        scale = np.sqrt(np.diag(information))
        return float(np.linalg.cond(information / np.outer(scale, scale)))

    # Linearisation.

    def _update(self) -> None:
        self._base = self._predicted()
        self._equations, self._rows = self._linearised(self._base)
        self._left: list[Eliminated] = [eliminate(window) for window in self._equations]

    def _predicted(self) -> Predicted:
        """Columns: here, a step in each parameter, in each velocity and tilt at the begin."""
        points = np.tile(self._x, (COLUMNS, 1))
        points[1 : COUNT + 1] += STEP * np.eye(COUNT)
        begin = np.tile(self._begin, (COLUMNS, 1, 1))
        for number in range(OWN):
            begin[COUNT + 1 + number, :, number] += STEP
        vehicles = [vehicle_of(self._start, point) for point in points]
        w = self._taken.windows
        down = w.down + np.einsum("wnik,cwk->cwni", w.tilted, begin[..., 4:])
        measured = Measured(w.period, *self._wrench(), w.rates[..., :2], down)
        return predict(coefficients(vehicles, self._taken.wake_share), begin[..., :4], measured)

    def _wrench(self) -> tuple[Floats, Floats]:
        """(columns or 1, windows, …, 4) Only the lag's column differs."""
        thrust, windows = self._taken.thrust, self._taken.windows
        if thrust is None or not self._taken.fits_lag:
            return self._taken.wrench[None], self._taken.mean[None]
        here = _wrench(thrust, windows, float(np.exp(self._x[LAG])))
        later = _wrench(thrust, windows, float(np.exp(self._x[LAG] + STEP)))
        found, means = (np.repeat(part[None], COLUMNS, axis=0) for part in here)
        found[1 + LAG], means[1 + LAG] = later
        return found, means

    def _linearised(self, base: Predicted) -> tuple[list[WindowEquations], list[Floats]]:
        equations, rows = list[WindowEquations](), list[Floats]()
        n = base.velocity.shape[2]
        since = times(n, self._taken.windows.period)
        for number in range(len(self._taken.windows.t)):
            parts = [self._channel(base, number, channel, since) for channel in self._channels]
            sizes = [len(part[0]) for part in parts]
            own = [_offsets(channel, part[2]) for channel, part in enumerate(parts)]
            tilts = [
                self._tilts(base, number, channel, part[2]) for channel, part in enumerate(parts)
            ]
            residual = np.concatenate([part[0] for part in parts])
            slope = np.concatenate([part[1] for part in parts])  # (rows, COUNT + OWN)
            offsets = _block_diagonal(own)
            estimate: Floats = (self._estimate[number] - self._begin[number]) / self._begin_std
            tilt_std = self._tilt_std(since)
            known = OWN + len(tilt_std)
            residual = np.concatenate([residual, estimate, np.zeros(len(tilt_std))])
            estimated = np.hstack([slope[:, COUNT:], np.vstack(tilts)])
            stds = np.concatenate([self._begin_std, tilt_std])
            estimated = np.vstack([estimated, np.diag(1.0 / stds)])
            common = np.vstack([slope[:, :COUNT], np.zeros((known, COUNT))])
            offsets = np.vstack([offsets, np.zeros((known, offsets.shape[1]))])
            block = np.concatenate([(part[2] / BLOCK_S).astype(np.int64) for part in parts])
            equations.append(
                WindowEquations(
                    residual, common, np.hstack([estimated, offsets]),
                    np.concatenate([block, np.zeros(known, dtype=np.int64)]),
                )
            )  # fmt: skip
            rows.append(np.concatenate([np.repeat(self._channels, sizes), np.full(known, -1)]))
        return equations, rows

    def _channel(
        self, base: Predicted, number: int, channel: int, since: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Residual (n,), slope (n, COUNT + OWN) by the parameters and the velocities at the begin,
        and the times [s]; in units of the noise."""
        w = self._taken.windows
        n = len(since)
        if channel == DEPTH:
            at = np.clip(w.depth_t[number] / w.period, 0, n - 1.001)
            index, share = at.astype(int), at - at.astype(int)
            depth = base.depth[:, number]
            predicted = depth[:, index] * (1 - share) + depth[:, index + 1] * share
            measured, when = w.depth[number], w.depth_t[number]
        elif channel == YAW:
            predicted, measured = base.velocity[:, number, :, 3], w.rates[number, :n, 2]
            when = since
        else:
            predicted = base.force[:, number, :, channel]
            measured, when = w.force[number, :n, channel], since
        std = self._noise[channel]
        slope = (predicted[1:] - predicted[0]) / STEP
        return (measured - predicted[0]) / std, slope.T / std, when

    def _tilt_std(self, since: Floats) -> Floats:
        """(2 knots,) [rad] Of each later change."""
        knots = len(np.arange(KNOT_S, since[-1], KNOT_S))
        return np.full(2 * knots, max(self._taken.wander, 1e-7) * np.sqrt(KNOT_S))

    def _tilts(self, base: Predicted, number: int, channel: int, when: Floats) -> Floats:
        """(n, 2 knots) By later changes of the tilt; in units of the noise. What little they change
        in the motion is left out."""
        w = self._taken.windows
        velocity = base.velocity[0, number, :, :3]
        n = len(velocity)
        since = times(n, w.period)
        knots = np.arange(KNOT_S, since[-1], KNOT_S)
        later = since[:, None] >= knots  # (n, knots)
        tilted = (w.tilted[number, :n, :, None, :] * later[:, None, :, None]).reshape(n, 3, -1)
        if channel == YAW:
            return np.zeros((n, tilted.shape[2]))
        if channel < YAW:
            return -GRAVITY * tilted[:, channel] / self._noise[channel]
        rate = np.einsum("ni,nik->nk", velocity, tilted)
        depth = w.period * np.cumsum(rate, axis=0)
        return columns_at(when, since, depth) / self._noise[DEPTH]


def _offsets(channel: int, when: Floats) -> Floats:
    """Offset, and of the accelerometers drift."""
    one = np.ones(len(when))
    return np.column_stack([one, when] if channel < YAW else [one])


def drag_at(
    start: Beginning, x: Floats, cov: Floats, axis: int, speed: float
) -> tuple[float, float]:
    """[N, N m] Drag of an axis at a speed, and its deviation."""
    by = np.zeros(COUNT)
    by[linear_of(axis)] = start.linear[axis] * speed
    by[quadratic_of(axis)] = start.quadratic[axis] * speed**2
    return float(by @ x), float(np.sqrt(max(0.0, by @ cov @ by)))


def buoyancy_of(found: Fit) -> tuple[float, float]:
    """[N] Value and deviation."""
    return float(found.x[BUOYANCY]), float(np.sqrt(found.covariance[BUOYANCY, BUOYANCY]))


def _wrench(thrust: CommandedThrust, windows: Windows, lag: float | None) -> tuple[Floats, Floats]:
    """(windows, n, 4) [N, N m], and (windows, n / 2, 4) its mean over each step."""
    t, ends = windows.t, _step_ends(windows)
    value = thrust.wrench(t.ravel(), lag).value.reshape(*t.shape, 6)
    integral = thrust.wrench(ends.ravel(), lag).integral.reshape(*ends.shape, 6)
    means = np.diff(integral, axis=1) / (2 * windows.period)
    return value[..., list(ROWS)], means[..., list(ROWS)]


def _step_ends(windows: Windows) -> Floats:
    """(windows, n / 2 + 1) [s]"""
    return np.column_stack([windows.t[:, ::2], windows.t[:, -1] + windows.period])


def _block_diagonal(parts: list[Floats]) -> Floats:
    rows, columns = sum(len(part) for part in parts), sum(part.shape[1] for part in parts)
    found, row, column = np.zeros((rows, columns)), 0, 0
    for part in parts:
        found[row : row + len(part), column : column + part.shape[1]] = part
        row, column = row + len(part), column + part.shape[1]
    return found
