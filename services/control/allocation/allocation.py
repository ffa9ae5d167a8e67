"""From a wrench to thruster commands, for any layout of thrusters.

The axes that the layout can drive independently are allocated by the pseudo-inverse (Fossen 2011,
§12.3.2), weighted with what each thruster can do; demands on other axes are ignored and show in
the achieved wrench. When thrusters saturate, axes are served in the order of `PRIORITY`: losing
the attitude, depth or heading disorients the pilot, losing speed does not. Within a group the
wrench keeps its direction, and what a full thruster cannot give the others take over as far as
they can (redistributed pseudo-inverse: Virnig & Bodden 1994, doi 10.2514/6.1994-3550).
"""

from dataclasses import dataclass
from math import copysign

import msgspec
import numpy as np

from messages.units import Vec6
from services.control.allocation.layout import AXES, AxisName, drivable, effect_matrix, independent
from services.control.allocation.thrust_bias import ThrustBias
from services.marine.thrusters import total_wrench
from services.marine.vehicle import Thruster, Vehicle

PRIORITY = (("roll", "pitch"), ("heave",), ("yaw",), ("surge", "sway"))
ROUNDING = 1e-9  # [N] a thruster with this little of a demand has no part in it
COMES_ON, GOES_OFF = 0.65, 0.35  # [-] of the dead-band: half of it, with hysteresis


class AllocationSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    dead_band_compensation: bool = True  # ask for the dead-band's edge instead of nothing
    biased: tuple[AxisName, ...] = ()  # thrusters of these axes turn against each other at rest


@dataclass(frozen=True, slots=True)
class Allocated:
    thrust: tuple[float, ...]  # [N] per thruster, command within its limits
    achieved: Vec6  # [N, N m] what they add up to, dead-bands and distrust included
    saturated: tuple[str, ...]  # names of the thrusters that could not give more


class Allocation:
    """Built once per vehicle. Plain floats: at this size five times faster than NumPy.

    A thruster that does not do what it is told is given a gain [-] with `trust`: it yields gain
    times the command. Inside, all forces are those that the thrusters yield.
    """

    def __init__(self, vehicle: Vehicle, settings: AllocationSettings | None = None) -> None:
        """
        Raises:
            ValueError: a thruster's direction has no length, or a bias is asked for that the
                layout does not have.
        """
        self._thrusters = vehicle.thruster
        self._settings = settings or AllocationSettings()
        self._effect = effect_matrix(vehicle)
        self._columns: list[Vec6] = [tuple(c) for c in self._effect.T.tolist()]
        self._gains = [1.0] * len(vehicle.thruster)
        self._on = [False] * len(vehicle.thruster)  # commanded although inside the dead-band
        self._learn_layout()
        self._axes_when_healthy = self.axes
        if self._settings.biased and not self._bias.sets:
            raise ValueError(
                f"control.allocation.biased: no thrusters that act on "
                f"{' or '.join(self._settings.biased)} can push against each other without "
                "moving the vehicle"
            )

    # What the layout can do.

    @property
    def lost(self) -> tuple[str, ...]:
        """Axes that distrusted thrusters have cost."""
        return tuple(axis for axis in AXES if axis in self._axes_when_healthy - self.axes)

    @property
    def distrusted(self) -> tuple[str, ...]:
        """Names of the thrusters whose gain is not 1."""
        pairs = zip(self._thrusters, self._gains, strict=True)
        return tuple(thruster.name for thruster, gain in pairs if gain != 1.0)

    def trust(self, index: int, gain: float) -> None:
        """Count on `gain` [-] times the command from this thruster: 1 healthy, 0 dead, −1
        reversed, between them weak."""
        if gain != self._gains[index]:
            self._gains[index] = gain
            self._learn_layout()

    def forget(self) -> None:
        """Forget which thrusters were driven out of their dead-band. For disarming."""
        self._on = [False] * len(self._on)

    # The work.

    def allocate(self, wrench: Vec6) -> Allocated:
        """Thruster commands for a wrench [N, N m], body frame, about the origin.

        `wrench` must be finite.
        """
        full = set[int]()
        yields = self._at_once(wrench) or self._in_turn(wrench, full)
        if any(wrench):
            yields = self._bias.added(yields, self._limits)
        thrust, yields = self._commands(yields)
        names = tuple([self._thrusters[index].name for index in sorted(full)])
        return Allocated(tuple(thrust), total_wrench(self._columns, yields), names)

    def _at_once(self, wrench: Vec6) -> list[float] | None:
        """What each thruster gives when no order of service could matter; else None."""
        x, y, z, k, m, n = wrench
        yields = list[float]()
        for (a, b, c, d, e, f), most in zip(self._all_shares, self._strength, strict=True):
            ax, by, cz, dk, em, fn = a * x, b * y, c * z, d * k, e * m, f * n
            if abs(ax) + abs(by) + abs(cz) + abs(dk) + abs(em) + abs(fn) > most:
                return None
            yields.append(ax + by + cz + dk + em + fn)
        return yields

    def _in_turn(self, wrench: Vec6, full: set[int]) -> list[float]:
        """Group after group; adds to `full` who was in the way of the rest."""
        yields = [0.0] * len(self._gains)
        for rows in self._groups:
            demand = [(row, wrench[row]) for row in rows if wrench[row]]
            if demand:
                yields = self._add(yields, demand, full)
        return yields

    def _add(
        self, yields: list[float], demand: list[tuple[int, float]], full: set[int]
    ) -> list[float]:
        """More of one group on top of `yields`, along its ray until all of it is there or nobody
        is left to give more.

        Args:
            demand: row and value of the group's part of the wrench.
        """
        left, frozen = 1.0, list[int]()
        while (columns := self._columns_without(frozen)) is not None:
            more = [0.0] * len(yields)
            for row, value in demand:
                more = [m + value * share for m, share in zip(more, columns[row], strict=True)]
            fits, who = self._that_fits(yields, more, left)
            yields = [force + fits * extra for force, extra in zip(yields, more, strict=True)]
            if who is None:
                return yields
            left -= fits
            frozen.append(who)
        full.update(frozen)
        return yields

    def _that_fits(
        self, yields: list[float], more: list[float], most: float
    ) -> tuple[float, int | None]:
        """Largest share ≤ `most` of `more` that stays within the limits, and who limits it."""
        share, who = most, None
        for index, (low, high) in enumerate(self._limits):
            force, extra = yields[index], more[index]
            if extra > ROUNDING:
                if force + share * extra > high:
                    share, who = max(0.0, (high - force) / extra), index
            elif extra < -ROUNDING and force + share * extra < low:
                share, who = max(0.0, (low - force) / extra), index
        return share, who

    def _commands(self, yields: list[float]) -> tuple[list[float], list[float]]:
        """[N] Commands for which the thrusters yield these forces, with the dead-bands stepped
        over, and what they will yield in truth (`marine.thrusters.driven`)."""
        thrust, truth = list[float](), list[float]()
        for index, (force, gain) in enumerate(zip(yields, self._gains, strict=True)):
            low, high, edge = self._bounds[index]
            # Rounding may leave it a hair outside.
            command = max(low, min(high, force / gain)) if gain else 0.0
            if -edge < command < edge:
                command = self._out_of_dead_band(index, command, edge)
            else:
                self._on[index] = True
            thrust.append(command)
            truth.append(0.0 if -edge < command < edge else gain * command)
        return thrust, truth

    def _out_of_dead_band(self, index: int, command: float, edge: float) -> float:
        """[N] Nothing or the dead-band's edge, whatever is nearer."""
        if not self._settings.dead_band_compensation:
            return command
        switch = GOES_OFF if self._on[index] else COMES_ON
        self._on[index] = abs(command) > edge * switch
        return copysign(edge, command) if self._on[index] else 0.0

    # The layout, each time the trust in a thruster changes.

    def _learn_layout(self) -> None:
        pairs = list(zip(self._gains, self._thrusters, strict=True))
        self._bounds = [(*_command_limits(t, gain), t.dead_band) for gain, t in pairs]  # [N]
        self._limits = [
            (min(gain * low, gain * high), max(gain * low, gain * high))
            for gain, (low, high, _) in zip(self._gains, self._bounds, strict=True)
        ]
        self._strength = [min(-low, high) for low, high in self._limits]  # [N]
        obeys = np.array(self._gains) == 1.0
        dead_bands = [thruster.dead_band for thruster in self._thrusters]
        self._bias = ThrustBias(self._effect * obeys, dead_bands, self._settings.biased)
        driven_axes = drivable(self._effect, self._strength)
        self.axes = frozenset(driven_axes)
        self._rows = [AXES.index(axis) for axis in driven_axes]
        self._groups = [
            {AXES.index(axis) for axis in group if axis in self.axes} for group in PRIORITY
        ]
        self._cache: dict[int, list[list[float]] | None] = {}  # by the bits of who is frozen
        columns = self._columns_without([]) or [[0.0] * len(pairs)] * 6
        self._all_shares = list(zip(*columns, strict=True))  # per thruster, of each row

    def _columns_without(self, frozen: list[int]) -> list[list[float]] | None:
        """Per row of the wrench: who gives how much of each newton, while the frozen ones stay as
        they are. None when the others cannot drive all the axes. Remembered, for it is slow."""
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
        shares[self._rows] = (weights[:, None] * inverse).T
        return shares.tolist()


def _command_limits(thruster: Thruster, gain: float) -> tuple[float, float]:
    """[N] Of the commands that a thruster answers in proportion. A reversed one answers a forward
    command with its weaker reverse thrust."""
    low, high = thruster.limits
    if gain >= 0.0:
        return low, high
    both_ways = min(-low, high)
    return -both_ways, both_ways
