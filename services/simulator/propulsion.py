"""The thrusters of a vessel: their thrust over time, and their wrench.

A thruster's thrust is its final value minus a sum of decaying modes (marine/thruster_lag.py). That
is solved exactly, without integration: between two commands the wrench of all thrusters is a
constant minus one decaying six-vector per mode.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

from messages.units import Vec6
from services.marine.thruster_lag import decay
from services.marine.thrusters import driven, total_wrench, wrench_per_newton
from services.marine.vehicle import Vehicle
from services.simulator.faults import Fault, settles_at

N = TypeVar("N", float, complex)
Gaps = list[complex]  # [N] what a mode lacks, per thruster; its real part counts


class SimulatedThrusters:
    """Advances by `pass_time`."""

    def __init__(self, vehicle: Vehicle, thrust: Sequence[float], scale: float = 1.0) -> None:
        """
        Args:
            thrust: [N] per thruster at the start; the commands are zero.
            scale: [-] real thrust over that in newtons of the vehicle file.
        """
        self.settles_at = [0.0] * len(thrust)  # [N] per thruster
        self._thrusters = vehicle.thruster
        self._columns = [_scaled(wrench_per_newton(t), scale) for t in vehicle.thruster]
        self._commands: Sequence[float] = self.settles_at  # [N]
        self._faults: Mapping[str, Fault] = {}
        self._dry: list[int] = []
        self.sag = 1.0  # [-] thrust over that with a full battery
        self._age = 0.0  # [s] since the newest change; the gaps are those of then
        modes = [{mode.pole: mode.share for mode in t.modes} for t in vehicle.thruster]
        self._poles = list({pole: None for shares in modes for pole in shares})  # thrusters share
        self._shares = [[shares.get(pole, 0.0) for shares in modes] for pole in self._poles]
        self._gaps: list[Gaps] = [
            [-share * newtons for share, newtons in zip(shares, thrust, strict=True)]
            for shares in self._shares
        ]
        self._add_up()

    def drive(self, thrust: Sequence[float]) -> None:
        """Command this thrust [N] from now on."""
        self._commands = thrust
        self._settle()

    def set_faults(self, faults: Mapping[str, Fault]) -> None:
        """Set the faults by thruster name; all others work."""
        self._faults = faults
        self._settle()

    def leave_water(self, dry: list[int]) -> None:
        """Set the thrusters, by index, that are in the air and produce nothing."""
        if dry != self._dry:
            self._dry = dry
            self._add_up()

    def pass_time(self, seconds: float) -> None:
        self._age += seconds

    @property
    def thrust(self) -> list[float]:
        """[N] per thruster now, as if in water."""
        thrust = self.settles_at
        for pole, gaps in zip(self._poles, self._gaps, strict=True):
            left = decay(pole, self._age)
            thrust = [t - (left * gap).real for t, gap in zip(thrust, gaps, strict=True)]
        return thrust

    @property
    def produced(self) -> list[float]:
        """[N] per thruster now, with sag; those out of the water produce none."""
        return [self.sag * newtons for newtons in self._in_water(self.thrust)]

    def wrench(self, ahead: float) -> Vec6:
        """τ = T f [N, N m] of all thrusters, `ahead` [s] from now (Fossen 2011, §12.3)."""
        surge, sway, heave, roll, pitch, yaw = self._settled
        for pole, (x, y, z, k, m, n) in self._decaying:
            left = decay(pole, self._age + ahead)
            surge -= (left * x).real
            sway -= (left * y).real
            heave -= (left * z).real
            roll -= (left * k).real
            pitch -= (left * m).real
            yaw -= (left * n).real
        wrench = surge, sway, heave, roll, pitch, yaw
        return wrench if self.sag == 1.0 else _scaled(wrench, self.sag)

    def _settle(self) -> None:
        """Set new final values. Thrust is continuous, because the shares of a thruster's modes add
        up to one."""
        pairs = zip(self._thrusters, self._commands, strict=True)
        if self._faults:
            wanted = [settles_at(t, command, self._faults.get(t.name)) for t, command in pairs]
        else:
            wanted = [driven(t, command) for t, command in pairs]
        steps = [after - before for after, before in zip(wanted, self.settles_at, strict=True)]
        for i, (pole, shares) in enumerate(zip(self._poles, self._shares, strict=True)):
            left = decay(pole, self._age)
            self._gaps[i] = [
                left * gap + share * step
                for gap, share, step in zip(self._gaps[i], shares, steps, strict=True)
            ]
        self.settles_at, self._age = wanted, 0.0
        self._add_up()

    def _add_up(self) -> None:
        """Sum the thrusters to wrenches."""
        self._settled = total_wrench(self._columns, self._in_water(self.settles_at))
        self._decaying = [
            (pole, total_wrench(self._columns, self._in_water(gaps)))
            for pole, gaps in zip(self._poles, self._gaps, strict=True)
        ]

    def _in_water(self, newtons: list[N]) -> list[N]:
        if not self._dry:
            return newtons
        return [value * 0 if i in self._dry else value for i, value in enumerate(newtons)]


def _scaled(column: Vec6, scale: float) -> Vec6:
    x, y, z, k, m, n = column
    return scale * x, scale * y, scale * z, scale * k, scale * m, scale * n
