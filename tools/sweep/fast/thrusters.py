"""Thrusters and battery of many dives: `services/simulator/propulsion.py` in lanes."""

from typing import Any

import numpy as np

from services.marine.vehicle import Vehicle, wrench_per_newton
from services.simulator.settings import Settings
from tools.sweep.fast.lanes import Lanes, Mask, total, where


class Thrusters:
    """Arrays are (thrusters, lanes), wrenches (6, lanes)."""

    def __init__(self, vehicle: Vehicle, count: int) -> None:
        thrusters, shape = vehicle.thruster, (len(vehicle.thruster), count)
        self.age: Any = 0.0  # [s] since the newest change, of each lane or of all
        self._columns = np.array([wrench_per_newton(t) for t in thrusters]).T
        self._low = np.array([[t.limits[0]] for t in thrusters])  # [N]
        self._high = np.array([[t.limits[1]] for t in thrusters])
        self._edge = np.array([[t.dead_band] for t in thrusters])
        modes = [{mode.pole: mode.share for mode in t.modes} for t in thrusters]
        self._poles = list({pole: None for shares in modes for pole in shares})
        self._shares = [np.array([[s.get(pole, 0.0)] for s in modes]) for pole in self._poles]
        self._gaps = [np.zeros(shape, shares.dtype) for shares in self._shares]  # [N]
        self._settles_at = np.zeros(shape)  # [N]
        self.wet = np.ones(shape, bool)
        self._add_up()

    def drive(self, thrust: Lanes) -> None:
        """Command this thrust [N] from now on."""
        permitted = np.clip(thrust, self._low, self._high)
        wanted = where(np.abs(permitted) >= self._edge, permitted, 0.0)
        step, self._settles_at = wanted - self._settles_at, wanted
        for k, (pole, shares) in enumerate(zip(self._poles, self._shares, strict=True)):
            self._gaps[k] = np.exp(pole * self.age) * self._gaps[k] + shares * step
        self.age = 0.0
        self._add_up()

    def leave_water(self, wet: Mask) -> None:
        if not np.array_equal(wet, self.wet):
            self.wet = wet
            self._add_up()

    @property
    def produced(self) -> Lanes:
        """[N] Now; nothing of a thruster in the air."""
        thrust = self._settles_at
        for pole, gaps in zip(self._poles, self._gaps, strict=True):
            thrust = thrust - (np.exp(pole * self.age) * gaps).real
        return thrust * self.wet

    def wrench(self, ahead: Any) -> Lanes:
        """[N, N m] `ahead` [s] from now."""
        wrench = self._settled
        for pole, decaying in zip(self._poles, self._decaying, strict=True):
            wrench = wrench - (np.exp(pole * (self.age + ahead)) * decaying).real
        return wrench

    def _add_up(self) -> None:
        self._settled = total(self._columns, self._settles_at * self.wet)
        self._decaying = [total(self._columns, gaps * self.wet) for gaps in self._gaps]


class LaneBattery:
    def __init__(self, vehicle: Vehicle, settings: Settings, count: int) -> None:
        self.used_wh = np.zeros(count)  # [Wh]
        self.power = np.full(count, settings.hotel_power)  # [W] drawn now
        self._settings = settings
        self._low = np.array([[t.limits[0]] for t in vehicle.thruster])  # [N]
        self._high = np.array([[t.limits[1]] for t in vehicle.thruster])

    def feed(self, thrust: Lanes, seconds: float) -> None:
        """Draw the power of this thrust [N] for `seconds`."""
        share = thrust / where(thrust >= 0.0, self._high, self._low)
        load = np.sum(share * np.sqrt(share), axis=0)
        self.power = self._settings.hotel_power + self._settings.thruster_power * load
        self.used_wh = self.used_wh + self.power * seconds / 3600

    @property
    def share_left(self) -> Lanes:
        """[-] of the charge."""
        return np.maximum(0.0, 1.0 - self.used_wh / self._settings.battery_capacity)
