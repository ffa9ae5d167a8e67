"""From the wrenches of many vehicles to their thrusters' commands: `Allocation` in lanes, with
healthy thrusters. Layout, limits and shares are the scalar law's own."""

from typing import Any, NamedTuple

import numpy as np

from services.control.allocation.allocation import (
    COMES_ON,
    GOES_OFF,
    ROUNDING,
    Allocation,
    AllocationSettings,
)
from services.control.allocation.thrust_bias import JUST_OUT, MOST, WELL_OUT, Bias
from services.marine.vehicle import Vehicle
from tools.sweep.fast.lanes import Lanes, Mask, total, where


class LaneAllocated(NamedTuple):
    thrust: Lanes  # [N] (thrusters, lanes)
    achieved: Lanes  # [N, N m] (6, lanes)
    saturated: Mask  # lanes with a thruster that limits an unmet demand


class LaneAllocation(Allocation):
    def __init__(self, vehicle: Vehicle, settings: AllocationSettings, count: int) -> None:
        super().__init__(vehicle, settings)
        self._low, self._high = np.array(self._limits).T[:, :, None]
        self._edges = np.array([[t.dead_band] for t in vehicle.thruster])
        self._matrix = np.array(self._columns).T  # (6, thrusters)
        self._whole = np.array(self._all_shares)  # (thrusters, 6)
        self._strengths = np.array(self._strength)[:, None]
        self._driven = np.zeros((len(vehicle.thruster), count), bool)
        self._biased = [np.zeros(count, bool) for _ in self._bias.sets]

    def allocate_all(self, wrench: Lanes) -> LaneAllocated:
        """Commands for a wrench (6, lanes) [N, N m]."""
        yields = total(self._whole, wrench)
        most = total(np.abs(self._whole), np.abs(wrench))
        full = np.any(most > self._strengths, axis=0)
        saturated = np.zeros(wrench.shape[1], bool)
        if np.any(full):
            yields[:, full], saturated[full] = self._in_order(wrench[:, full])
        for number, bias in enumerate(self._bias.sets):
            self._push(yields, bias, number, np.any(wrench != 0.0, axis=0))
        command = np.clip(yields, self._low, self._high)
        size = np.abs(command)
        inside = size < self._edges
        if self._settings.dead_band_compensation:
            switch = where(self._driven, GOES_OFF, COMES_ON)
            self._driven = ~inside | (size > self._edges * switch)
            edge = where(self._driven, np.copysign(self._edges, command), 0.0)
            command = where(inside, edge, command)
        else:
            self._driven |= ~inside
        achieved = where(np.abs(command) < self._edges, 0.0, command)
        return LaneAllocated(command, total(self._matrix, achieved), saturated)

    def _in_order(self, wrench: Lanes) -> tuple[Lanes, Mask]:
        """Group by group, see `_by_priority`."""
        count = wrench.shape[1]
        yields = np.zeros((len(self._gains), count))
        rows = [sorted(group) for group in self._groups]
        left = np.ones((len(rows), count))
        limited = np.zeros((len(rows), count), int)  # bit masks of the limiting thrusters
        for newest in range(len(rows)):
            for turn in (newest, *range(newest)):
                asks = np.any(wrench[rows[turn]] != 0.0, axis=0) & (left[turn] > 0.0)
                self._add_all(yields, wrench, rows[turn], left[turn], limited[turn], asks)
        return yields, np.any(limited != 0, axis=0)

    def _add_all(
        self, yields: Lanes, wrench: Lanes, rows: list[int], left: Lanes, limited: Any, asks: Mask
    ) -> None:
        """Add a group's demand until it is met or no thruster has capacity left, in place."""
        limited[asks] = 0
        pending: Any = np.flatnonzero(asks)
        while len(pending):
            following = list[Any]()
            for key in np.unique(limited[pending]).tolist():
                these = pending[limited[pending] == key]
                shares = self._columns_without([k for k in range(len(self._gains)) if key >> k & 1])
                if shares is None:
                    continue
                more = total(np.array(shares)[rows].T, wrench[rows][:, these])
                fits, limiting = self._fitting(yields[:, these], more, left[these])
                yields[:, these] += fits * more
                met = limiting < 0
                left[these] = where(met, 0.0, left[these] - fits)
                # Of a demand that is met nothing is limited.
                limited[these] = where(met, 0, limited[these] | 1 << np.maximum(0, limiting))
                following.append(these[~met])
            pending = np.concatenate(following) if following else pending[:0]
            if not self._settings.redistribute:
                return

    def _fitting(self, yields: Lanes, more: Lanes, most: Lanes) -> tuple[Lanes, Any]:
        """`_largest_share` of each lane, and the thruster that limits it; -1: none."""
        share, limiting = most.copy(), np.full(len(most), -1)
        for index in range(len(more)):
            force, extra = yields[index], more[index]
            reached = force + share * extra
            over = (extra > ROUNDING) & (reached > self._high[index])
            over |= (extra < -ROUNDING) & (reached < self._low[index])
            if np.any(over):
                end = where(extra > 0.0, self._high[index], self._low[index])
                room = np.maximum(0.0, (end - force) / where(over, extra, 1.0))
                share, limiting = where(over, room, share), where(over, index, limiting)
        return share, limiting

    def _push(self, yields: Lanes, bias: Bias, number: int, asks: Mask) -> None:
        """A set of thrusters out of their dead-bands, see `ThrustBias.added`."""
        these = [index for index, _ in bias]
        parts = np.array([[part] for _, part in bias])
        forces, edges = yields[these], self._edges[these]
        enough = where(self._biased[number], WELL_OUT, 1.0)
        on = np.any(np.abs(forces) < enough * edges, axis=0)
        self._biased[number] = where(asks, on, self._biased[number])
        strength = np.max((np.copysign(JUST_OUT * edges, parts) - forces) / parts, axis=0)
        pushed = forces + strength * parts
        fits = np.all((self._low[these] <= pushed) & (pushed <= self._high[these]), axis=0)
        fits &= asks & on & (strength <= MOST * np.max(edges))
        yields[these] = where(fits, pushed, forces)
