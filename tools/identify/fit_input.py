"""What a fit is made from: stretches of a dive, and the thrust in them."""

from typing import NamedTuple

import numpy as np

from services.control.allocation.layout import effect_matrix
from services.marine.vehicle import Vehicle
from tools.identify.dive_data import DiveData, Windows, columns_at
from tools.identify.motion_model import ROWS
from tools.identify.thrust import CommandedThrust, Floats

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
    wrench, means = wrench_over(thrust, found, None)
    return FitInput(found, thrust, wrench, means, data.wander, wake_share, fits_lag)


def busiest(taken: FitInput) -> FitInput:
    """Only the windows in which the wrench changes most."""
    spread = taken.wrench.std(axis=1)
    scale = np.maximum(spread.max(axis=0, initial=0.0), 1e-9)
    order = np.argsort(-(spread / scale).max(axis=1, initial=0.0), kind="stable")[:MOST_WINDOWS]
    keep = np.sort(order)
    return only(taken, [int(n) for n in keep])


def only(taken: FitInput, keep: list[int]) -> FitInput:
    """These windows."""
    w = taken.windows
    windows = w._replace(
        t=w.t[keep], rates=w.rates[keep], force=w.force[keep], down=w.down[keep],
        tilted=w.tilted[keep],
        begin=w.begin[keep], depth_t=[w.depth_t[n] for n in keep],
        depth=[w.depth[n] for n in keep],
    )  # fmt: skip
    return taken._replace(windows=windows, wrench=taken.wrench[keep], mean=taken.mean[keep])


def wrench_over(
    thrust: CommandedThrust, windows: Windows, lag: float | None
) -> tuple[Floats, Floats]:
    """(windows, n, 4) [N, N m], and (windows, n / 2, 4) its mean over each step."""
    t, ends = windows.t, _step_ends(windows)
    value = thrust.wrench(t.ravel(), lag).value.reshape(*t.shape, 6)
    integral = thrust.wrench(ends.ravel(), lag).integral.reshape(*ends.shape, 6)
    means = np.diff(integral, axis=1) / (2 * windows.period)
    return value[..., list(ROWS)], means[..., list(ROWS)]


def _step_ends(windows: Windows) -> Floats:
    """(windows, n / 2 + 1) [s]"""
    return np.column_stack([windows.t[:, ::2], windows.t[:, -1] + windows.period])
