"""The thrusters' wrench over time, from the commands: dead-band, limits, lag."""

from cmath import exp as complex_exp
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.marine.vehicle import LagMode, Vehicle, driven, first_order, wrench_per_newton

Floats = NDArray[np.float64]
LOST = 20.0  # [-] decay, as an exponent, over which steps are added up at once


class Lagged(NamedTuple):
    value: Floats  # (m, k)
    integral: Floats  # (m, k) since the first command


class CommandedThrust:
    """Commands, each of which holds until the next one."""

    def __init__(self, vehicle: Vehicle, t: Floats, commands: Floats) -> None:
        """
        Args:
            t: (n,) [s] rising.
            commands: (n, thrusters) [N]
        """
        self.t = t
        effect = np.array([wrench_per_newton(thruster) for thruster in vehicle.thruster])
        settles = np.array(
            [
                [driven(thruster, newtons) for thruster, newtons in zip(vehicle.thruster, row)]  # noqa: B905
                for row in commands.tolist()
            ]
        )
        self._whole = settles @ effect  # (n, 6) [N, N m]
        # Thrusters of the same lag together.
        self._groups = [
            (modes, settles[:, same] @ effect[same]) for modes, same in _by_lag(vehicle)
        ]

    def wrench(self, at: Floats, lag: float | None = None) -> Lagged:
        """(m, 6) [N, N m] at these times [s], and its integral.

        Args:
            lag: [s] of all thrusters, first order; None: as the vehicle file says.
        """
        if lag is not None:
            return lagged(self.t, self._whole, first_order(lag), at)
        parts = [lagged(self.t, whole, modes, at) for modes, whole in self._groups]
        return Lagged(*(np.sum(part, axis=0) for part in zip(*parts, strict=True)))


def lagged(t: Floats, settles: Floats, modes: Sequence[LagMode], at: Floats) -> Lagged:
    """A quantity that follows `settles` (n, k), set at the times t (n,), from rest, at the times
    `at` (m,); exact (services/marine/vehicle.py). A gap decays by g' = pole g + share s',
    which also gives its integral."""
    steps = np.diff(settles, axis=0, prepend=0.0)
    index = np.clip(np.searchsorted(t, at, side="right") - 1, 0, None)
    since = np.maximum(at - t[index], 0.0)[:, None]
    now = settles[index]
    held = np.cumsum(settles[:-1] * np.diff(t)[:, None], axis=0)
    value, integral = now.copy(), np.vstack([np.zeros_like(settles[:1]), held])[index]
    integral += now * since
    for pole, share in modes:
        gap = np.exp(pole * since) * _gaps(t, (share * steps).astype(np.complex128), pole)[index]
        value -= np.real(gap)
        integral -= np.real((gap - share * now) / pole)
    return Lagged(value, integral)


def _gaps(t: Floats, steps: NDArray[np.complex128], pole: complex) -> NDArray[np.complex128]:
    """(n, k) The sum of all steps so far, each decayed since its time. Added up within stretches in
    which little of the first is lost, so that no quotient overflows."""
    found = np.empty(steps.shape, dtype=np.complex128)
    gap = np.zeros(steps.shape[1], dtype=np.complex128)  # at the time before
    first, before = 0, float(t[0])
    while first < len(t):
        until = float(t[first]) + LOST / abs(pole)
        last = int(np.searchsorted(t, until, side="right"))
        decayed: NDArray[np.complex128] = np.exp(pole * (t[first:last] - t[first]))[:, None]
        begin = gap * complex_exp(pole * (float(t[first]) - before))
        found[first:last] = decayed * (begin + np.cumsum(steps[first:last] / decayed, axis=0))
        gap, before, first = found[last - 1], float(t[last - 1]), last
    return found


def _by_lag(vehicle: Vehicle) -> list[tuple[list[LagMode], list[int]]]:
    """Lags, and the indices of the thrusters that have them."""
    found: list[tuple[list[LagMode], list[int]]] = []
    for index, thruster in enumerate(vehicle.thruster):
        for modes, same in found:
            if modes == thruster.modes:
                same.append(index)
                break
        else:
            found.append((thruster.modes, [index]))
    return found
