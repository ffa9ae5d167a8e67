"""From a wrench to thruster commands, for any layout of thrusters.

The axes that the layout can drive independently are allocated by the pseudo-inverse (Fossen 2011,
§12.3.2), weighted by each thruster's capacity; demands on other axes are ignored and show in the
achieved wrench. When thrusters saturate, axes are allocated in the order of `PRIORITY`: losing the
attitude, depth or heading disorients the pilot, losing speed does not. Within a group the wrench
keeps its direction, and the other thrusters replace a saturated one as far as they can
(redistributed pseudo-inverse: Virnig & Bodden 1994, doi 10.2514/6.1994-3550).
"""

from dataclasses import dataclass
from math import copysign

import msgspec
import numpy as np

from messages.units import Vec6
from services.control.allocation.layout import (
    AXES,
    AxisName,
    drivable,
    effect_matrix,
    independent,
    on_any_processor,
)
from services.control.allocation.thrust_bias import ThrustBias
from services.marine.vehicle import Vehicle, total_wrench

PRIORITY = (("roll", "pitch"), ("heave",), ("yaw",), ("surge", "sway"))
ROUNDING = 1e-9  # [N] a smaller share of a demand counts as none
COMES_ON, GOES_OFF = 0.65, 0.35  # [-] of the dead-band: half of it, with hysteresis


class AllocationSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    dead_band_compensation: bool = True  # round up to the dead-band's edge instead of to nothing
    # The others take over what a saturated thruster cannot give. False where a board mixes fixed
    # axes into the thrusters, as ArduSub does: there the whole group is scaled down.
    redistribute: bool = True
    biased: tuple[AxisName, ...] = ()  # thrusters of these axes get a thrust bias


@dataclass(frozen=True, slots=True)
class Allocated:
    thrust: tuple[float, ...]  # [N] per thruster, command within its limits
    achieved: Vec6  # [N, N m] their wrench, dead-bands included
    saturated: tuple[str, ...]  # names of the thrusters at their limits


class Allocation:
    """Built once per vehicle. Plain floats: at this size five times faster than NumPy.

    `axes` are those that can be driven independently.
    """

    def __init__(self, vehicle: Vehicle, settings: AllocationSettings | None = None) -> None:
        """
        Raises:
            ValueError: the layout does not allow the configured bias.
        """
        self._thrusters = vehicle.thruster
        self._settings = settings or AllocationSettings()
        self._effect = effect_matrix(vehicle)
        self._columns: list[Vec6] = [tuple(c) for c in self._effect.T.tolist()]
        self._on = [False] * len(vehicle.thruster)  # driven at the dead-band's edge or beyond
        self._limits = [thruster.limits for thruster in vehicle.thruster]  # [N]
        self._strength = [min(-low, high) for low, high in self._limits]  # [N]
        dead_bands = [thruster.dead_band for thruster in vehicle.thruster]  # [N]
        self._bias = ThrustBias(self._effect, dead_bands, self._settings.biased)
        driven_axes = drivable(self._effect, self._strength)
        self.axes = frozenset(driven_axes)
        self._rows = [AXES.index(axis) for axis in driven_axes]
        self._groups = [
            {AXES.index(axis) for axis in group if axis in self.axes} for group in PRIORITY
        ]
        self._cache: dict[int, list[list[float]] | None] = {}  # by bit mask of frozen thrusters
        columns = self._columns_without([]) or [[0.0] * len(vehicle.thruster)] * 6
        self._all_shares = list(zip(*columns, strict=True))  # per thruster, of each row
        if self._settings.biased and not self._bias.sets:
            raise ValueError(
                f"control.allocation.biased: no thrusters that act on "
                f"{' or '.join(self._settings.biased)} can push against each other without "
                "moving the vehicle"
            )

    def forget(self) -> None:
        """Reset the hysteresis of the dead-bands. For disarming."""
        self._on = [False] * len(self._on)

    # Allocation.

    def allocate(self, wrench: Vec6) -> Allocated:
        """Thruster commands for a wrench [N, N m], body frame, about the origin.

        `wrench` must be finite.
        """
        yields, saturated = self._at_once(wrench), ()
        if yields is None:
            yields, saturated = self._by_priority(wrench)
        if self._bias.sets and any(wrench):
            yields = self._bias.added(yields, self._limits)
        # Commands with dead-band compensation, and the forces they yield (`marine.vehicle.driven`).
        thrust, achieved = list[float](), list[float]()
        for index, force in enumerate(yields):
            (low, high), edge = self._limits[index], self._thrusters[index].dead_band
            command = max(low, min(high, force))  # rounding may exceed the limits slightly
            if not -edge < command < edge:
                self._on[index] = True
            elif self._settings.dead_band_compensation:
                # Zero or the dead-band's edge, whichever is nearer, with hysteresis.
                switch = GOES_OFF if self._on[index] else COMES_ON
                self._on[index] = abs(command) > edge * switch
                command = copysign(edge, command) if self._on[index] else 0.0
            thrust.append(command)
            achieved.append(0.0 if -edge < command < edge else command)
        return Allocated(tuple(thrust), total_wrench(self._columns, achieved), saturated)

    def _at_once(self, wrench: Vec6) -> list[float] | None:
        """Forces for the whole wrench if no thruster can saturate in any order; else None."""
        x, y, z, k, m, n = wrench
        yields = list[float]()
        for (a, b, c, d, e, f), most in zip(self._all_shares, self._strength, strict=True):
            ax, by, cz, dk, em, fn = a * x, b * y, c * z, d * k, e * m, f * n
            if abs(ax) + abs(by) + abs(cz) + abs(dk) + abs(em) + abs(fn) > most:
                return None
            yields.append(ax + by + cz + dk + em + fn)
        return yields

    def _by_priority(self, wrench: Vec6) -> tuple[list[float], tuple[str, ...]]:
        """Forces group by group, and the names of the thrusters that limit an unmet demand.

        A lateral thruster ahead of the centre turns the vehicle, and other thrusters have to
        compensate that. Where it turns the vehicle the way that is wanted, they are relieved, and
        can give more of a group that came before. So after each group those before it have another
        turn; none ever gets less by a group that comes after it.
        """
        yields = [0.0] * len(self._thrusters)
        left = [1.0] * len(self._groups)  # [-] of each group's demand
        limiting: list[list[int]] = [[] for _ in self._groups]
        demands = [[(row, wrench[row]) for row in rows if wrench[row]] for rows in self._groups]
        for newest in range(len(demands)):
            for turn in (newest, *range(newest)):
                if demands[turn] and left[turn] > 0.0:
                    yields, left[turn], limiting[turn] = self._add(
                        yields, demands[turn], left[turn]
                    )
        saturated = sorted(set[int]().union(*limiting))
        return yields, tuple(self._thrusters[index].name for index in saturated)

    def _add(
        self, yields: list[float], demand: list[tuple[int, float]], left: float
    ) -> tuple[list[float], float, list[int]]:
        """Add one group's demand to `yields`, in its direction, until it is met or no thruster has
        capacity left. Returns also the share that is not met, and the thrusters that limit it.

        Args:
            demand: row and value of the group's part of the wrench.
            left: [-] share of it that is not in `yields` yet.
        """
        frozen = list[int]()
        while (columns := self._columns_without(frozen)) is not None:
            more = [0.0] * len(yields)
            for row, value in demand:
                more = [m + value * share for m, share in zip(more, columns[row], strict=True)]
            fits, limiting = self._largest_share(yields, more, left)
            yields = [force + fits * extra for force, extra in zip(yields, more, strict=True)]
            if limiting is None:
                return yields, 0.0, []
            left -= fits
            frozen.append(limiting)
            if not self._settings.redistribute:
                break
        return yields, left, frozen

    def _largest_share(
        self, yields: list[float], more: list[float], most: float
    ) -> tuple[float, int | None]:
        """Largest share ≤ `most` of `more` within the limits, and the thruster that limits it."""
        share, limiting = most, None
        for index, (low, high) in enumerate(self._limits):
            force, extra = yields[index], more[index]
            if extra > ROUNDING:
                if force + share * extra > high:
                    share, limiting = max(0.0, (high - force) / extra), index
            elif extra < -ROUNDING and force + share * extra < low:
                share, limiting = max(0.0, (low - force) / extra), index
        return share, limiting

    def _columns_without(self, frozen: list[int]) -> list[list[float]] | None:
        """Per row of the wrench: each thruster's share of one newton, without the frozen ones. None
        when the others cannot drive all axes. Cached, because it is slow."""
        key = 0
        for index in frozen:
            key |= 1 << index
        if key not in self._cache:
            self._cache[key] = self._shares(frozen)
        return self._cache[key]

    def _shares(self, frozen: list[int]) -> list[list[float]] | None:
        strength = [0.0 if i in frozen else s for i, s in enumerate(self._strength)]
        if not self.axes or not independent(self._effect, strength, self.axes):
            return None
        weights = np.array(strength) / max(strength)
        shares = np.zeros((6, len(strength)))
        inverse = np.linalg.pinv(self._effect[self._rows] * weights)
        shares[self._rows] = on_any_processor(weights[:, None] * inverse).T
        return shares.tolist()
