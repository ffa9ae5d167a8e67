"""The thrusters of a vessel: their thrust over time, their wrench, and the battery they empty.

A thruster's thrust is its final value minus a sum of decaying modes (marine/vehicle.py). That is
solved exactly, without integration: between two commands the wrench of all thrusters is a constant
minus one decaying six-vector per mode.

Power of a thruster grows with |thrust| to the power 1.5 (momentum theory of a propeller at rest in
the water: P = T √(T / 2ρA)), scaled to the known power at full thrust, each way.
"""

from collections.abc import Mapping, Sequence

from messages.sensors import BatterySample
from messages.units import Vec6
from services.marine.vehicle import (
    ComplexVec6,
    Vehicle,
    decay,
    driven,
    total_wrench,
    wrench_per_newton,
)
from services.simulator.faults import Fault, settles_at
from services.simulator.settings import Settings

Gaps = list[complex]  # [N] what a mode lacks, per thruster; its real part counts
NONE: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SimulatedThrusters:
    """Whoever advances the time adds it to `age`."""

    def __init__(self, vehicle: Vehicle, thrust: Sequence[float], scale: float = 1.0) -> None:
        """
        Args:
            thrust: [N] per thruster at the start; the commands are zero.
            scale: [-] real thrust over that in newtons of the vehicle file.
        """
        self.settles_at = [0.0] * len(thrust)  # [N] per thruster
        self.age = 0.0  # [s] since the newest change; the gaps are those of then
        self._thrusters = vehicle.thruster
        self._columns = [_scaled(wrench_per_newton(t), scale) for t in vehicle.thruster]
        self._in_water = self._columns  # of a thruster in the air zero
        self._commands: Sequence[float] = [0.0] * len(thrust)  # [N]
        self._faults: Mapping[str, Fault] = {}
        self._dry: list[int] = []
        modes = [{mode.pole: mode.share for mode in t.modes} for t in vehicle.thruster]
        self._poles = list({pole: None for shares in modes for pole in shares})  # thrusters share
        self._shares = [[shares.get(pole, 0.0) for shares in modes] for pole in self._poles]
        self._gaps: list[Gaps] = [
            [-share * newtons for share, newtons in zip(shares, thrust, strict=True)]
            for shares in self._shares
        ]
        self._add_up()

    def drive(self, thrust: Sequence[float]) -> None:
        """Command this thrust [N] from now on. What is produced is continuous, because the shares
        of a thruster's modes add up to one."""
        self._commands = thrust
        steps = list[float]()  # [N] from what each thruster settled at before
        for i, (thruster, command) in enumerate(zip(self._thrusters, thrust, strict=True)):
            fault = self._faults.get(thruster.name)
            wanted = (
                driven(thruster, command) if fault is None else settles_at(thruster, command, fault)
            )
            steps.append(wanted - self.settles_at[i])
            self.settles_at[i] = wanted
        # What is left of each mode's gap, and its share of the new step.
        for pole, shares, gaps in zip(self._poles, self._shares, self._gaps, strict=True):
            left = decay(pole, self.age)
            for i, step in enumerate(steps):
                gaps[i] = left * gaps[i] + shares[i] * step
        self.age = 0.0
        self._add_up()

    def set_faults(self, faults: Mapping[str, Fault]) -> None:
        """Set the faults by thruster name; all others work."""
        self._faults = faults
        self.drive(self._commands)

    def leave_water(self, dry: list[int]) -> None:
        """Set the thrusters, by index, that are in the air and produce nothing."""
        if dry != self._dry:
            self._dry = dry
            self._in_water = [NONE if i in dry else t for i, t in enumerate(self._columns)]
            self._add_up()

    @property
    def thrust(self) -> list[float]:
        """[N] per thruster now, as if in water."""
        thrust = self.settles_at.copy()
        for pole, gaps in zip(self._poles, self._gaps, strict=True):
            left = decay(pole, self.age)
            for i, gap in enumerate(gaps):
                thrust[i] -= (left * gap).real
        return thrust

    @property
    def produced(self) -> list[float]:
        """[N] per thruster now; those out of the water produce none."""
        produced = self.thrust
        for i in self._dry:
            produced[i] = 0.0
        return produced

    def wrench(self, ahead: float) -> Vec6:
        """τ = T f [N, N m] of all thrusters, `ahead` [s] from now (Fossen 2011, §12.3)."""
        surge, sway, heave, roll, pitch, yaw = self._settled
        for pole, (x, y, z, k, m, n) in self._decaying:
            left = decay(pole, self.age + ahead)
            surge -= (left * x).real
            sway -= (left * y).real
            heave -= (left * z).real
            roll -= (left * k).real
            pitch -= (left * m).real
            yaw -= (left * n).real
        return surge, sway, heave, roll, pitch, yaw

    def _add_up(self) -> None:
        """Sum the thrusters to wrenches."""
        self._settled = total_wrench(self._in_water, self.settles_at)
        self._decaying = list[tuple[complex, ComplexVec6]]()
        for pole, gaps in zip(self._poles, self._gaps, strict=True):
            self._decaying.append((pole, total_wrench(self._in_water, gaps)))


class Battery:
    def __init__(self, vehicle: Vehicle, settings: Settings, used_wh: float = 0.0) -> None:
        self.used_wh = used_wh  # [Wh]
        self.power = settings.hotel_power  # [W] drawn now
        self._settings = settings
        self._limits = [thruster.limits for thruster in vehicle.thruster]  # [N]

    def feed(self, thrust: Sequence[float], seconds: float) -> None:
        """Draw the power of this thrust [N] per thruster for `seconds`."""
        load = 0.0  # [-] one for each thruster at its limit
        for newtons, (reverse, forward) in zip(thrust, self._limits, strict=True):
            share = newtons / forward if newtons >= 0 else newtons / reverse
            load += share * share**0.5
        self.power = self._settings.hotel_power + self._settings.thruster_power * load
        self.used_wh += self.power * seconds / 3600

    @property
    def left_wh(self) -> float:
        """[Wh]"""
        return max(0.0, self._settings.battery_capacity - self.used_wh)

    @property
    def empty(self) -> bool:
        """The vehicle still runs: the battery model is too rough to end a dive."""
        return self.left_wh == 0.0

    def sample(self, now: int, share: float | None = None) -> BatterySample:
        """Voltage falls linearly with the charge, and with the current.

        Args:
            share: [-] of the charge, where a fault says how much is left.
        """
        s = self._settings
        left = self.left_wh / s.battery_capacity if share is None else share
        open_circuit = s.battery_empty + left * (s.battery_full - s.battery_empty)
        return BatterySample(
            stamp_ns=now,
            voltage=max(0.0, open_circuit - s.battery_resistance * self.power / open_circuit),
            current=self.power / open_circuit,
            used_wh=self.used_wh if share is None else (1.0 - share) * s.battery_capacity,
            capacity_wh=s.battery_capacity,
        )


def _scaled(column: Vec6, scale: float) -> Vec6:
    x, y, z, k, m, n = column
    return scale * x, scale * y, scale * z, scale * k, scale * m, scale * n
