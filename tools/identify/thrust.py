"""The thrusters' wrench over time, from the commands: dead-band, limits, lag."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.marine.thruster_lag import LagMode, first_order
from services.marine.thrusters import driven, wrench_per_newton
from services.marine.vehicle import Vehicle

Floats = NDArray[np.float64]


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

    def wrench(self, at: Floats, lag: float | None = None) -> Floats:
        """(m, 6) [N, N m] at these times [s].

        Args:
            lag: [s] of all thrusters, first order; None: as the vehicle file says.
        """
        if lag is not None:
            return lagged(self.t, self._whole, first_order(lag), at)
        return np.sum([lagged(self.t, whole, modes, at) for modes, whole in self._groups], axis=0)


def lagged(t: Floats, settles: Floats, modes: Sequence[LagMode], at: Floats) -> Floats:
    """(m, k) A quantity that follows `settles` (n, k), set at the times t (n,), from rest, at the
    times `at` (m,); exact (services/marine/thruster_lag.py)."""
    steps = np.diff(settles, axis=0, prepend=0.0)
    index = np.clip(np.searchsorted(t, at, side="right") - 1, 0, None)
    since = np.maximum(at - t[index], 0.0)
    found = settles[index].copy()
    waits = np.diff(t, prepend=t[0])
    for pole, share in modes:
        left = np.exp(pole * waits)
        gap = np.zeros(settles.shape[1], dtype=np.result_type(left, float))
        gaps = np.empty(settles.shape, dtype=gap.dtype)
        for n in range(len(t)):
            gap = left[n] * gap + share * steps[n]
            gaps[n] = gap
        found -= np.real(np.exp(pole * since)[:, None] * gaps[index])
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
