"""From a wrench to thruster commands, for any layout of thrusters.

The axes that the layout can drive independently are allocated by the pseudo-inverse (Fossen 2011,
§12.3.2), weighted by each thruster's capacity; demands on other axes are ignored and show in the
achieved wrench. When thrusters saturate, axes are allocated in the order of `PRIORITY`: losing the
attitude, depth or heading disorients the pilot, losing speed does not. Within a group the wrench
keeps its direction, and the other thrusters replace a saturated one as far as they can
(redistributed pseudo-inverse: Virnig & Bodden 1994, doi 10.2514/6.1994-3550).
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from math import copysign
from typing import Literal, get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages.units import Vec6
from services.marine.vehicle import Vehicle, total_wrench, wrench_per_newton

# The axes that a layout of thrusters can drive, each independently of the others. The test is
# stricter than rank: an axis counts as driven when it costs at most `MOST_COST` newtons of thrust
# per newton of force with all other driven axes at zero. Two thrusters on the same line count once;
# a lever arm of a few millimetres does not count.


Matrix = NDArray[np.float64]
AxisName = Literal["surge", "sway", "heave", "roll", "pitch", "yaw"]
AXES: tuple[AxisName, ...] = get_args(AxisName)  # rows of a wrench
PREFERRED = ("heave", "yaw", "surge", "sway", "roll", "pitch")  # order, if not all are possible
PILOTING = ("surge", "heave", "yaw")  # axes that a pilot needs
MOST_COST = 10.0  # [-] newtons of thrust per newton, or per newton metre over the longest arm
SHORTEST_ARM = 0.01  # [m] a layout without any longer one turns nothing
DIGITS = 12  # after the point, of parts of a newton or a newton metre
SINGULAR = 0.01  # [-] a singular value this small costs far more than that


def effect_matrix(vehicle: Vehicle) -> Matrix:
    """(6, n) wrench about the origin per newton of each thruster (Fossen 2011, §12.3)."""
    return np.array([wrench_per_newton(thruster) for thruster in vehicle.thruster]).T


def drivable(effect: Matrix, strength: Sequence[float]) -> tuple[str, ...]:
    """Axes that these thrusters can drive independently, in the order of `AXES`.

    Args:
        effect: (6, n) from `effect_matrix`.
        strength: (n,) [N] thrust limit in the weaker direction; 0 when dead.
    """
    chosen = list[str]()
    for axis in PREFERRED:
        if independent(effect, strength, [*chosen, axis]):
            chosen.append(axis)
    return tuple(axis for axis in AXES if axis in chosen)


def independent(effect: Matrix, strength: Sequence[float], axes: Iterable[str]) -> bool:
    """Whether these axes can be driven independently; arguments as of `drivable`.

    Column i of the pseudo-inverse is the least thrust for one unit of axis i and none of the
    others.
    """
    rows = _comparable(effect, strength)[[AXES.index(axis) for axis in axes]]
    if np.linalg.matrix_rank(rows, tol=SINGULAR) < len(rows):
        return False
    return bool(np.all(np.linalg.norm(np.linalg.pinv(rows), axis=0) <= MOST_COST))


def on_any_processor(solved: Matrix) -> Matrix:
    """What a library has solved, without the last digits, which differ between processors."""
    return solved.round(DIGITS) + 0.0  # which makes 0.0 of -0.0


def require_pilotable(vehicle: Vehicle) -> None:
    """
    Raises:
        ValueError: the thrusters cannot drive the axes that a pilot needs.
    """
    strength = [min(-t.limits[0], t.limits[1]) for t in vehicle.thruster]
    driven = drivable(effect_matrix(vehicle), strength)
    missing = [axis for axis in PILOTING if axis not in driven]
    if missing:
        raise ValueError(
            f"vehicle.thruster: these {len(strength)} thrusters cannot drive "
            f"{' and '.join(missing)} independently of the other axes, only "
            f"{', '.join(driven) or 'none'}"
        )


def _comparable(effect: Matrix, strength: Sequence[float]) -> Matrix:
    """Rows in comparable units: columns relative to the strongest thruster, moments as forces at
    the longest arm of the layout."""
    strongest = max(strength, default=0.0)
    if not strongest > 0:
        return np.zeros_like(effect)
    arm = max(SHORTEST_ARM, float(np.linalg.norm(effect[3:], axis=0).max()))
    scale = np.array([1.0, 1.0, 1.0, *[1.0 / arm] * 3])
    return scale[:, None] * effect * (np.array(strength) / strongest)


# Thrust bias: thrusters run against each other, so that none of them is in its dead-band. With
# more thrusters than axes, forces without any wrench can be added: vectors b with T b = 0. With a
# large enough b every thruster of a set turns all the time, and small forces are as exact as large
# ones: a drone with little drag holds its heading without a limit cycle. Dynamic positioning of
# ships uses the same method, thruster biasing. The price is the power of the bias.


LEAST_PART = 1e-6  # [-] smaller parts are rounding
EVEN = 0.5  # [-] least ratio of smallest to largest part of a bias; below, it costs too much
Bias = list[tuple[int, float]]  # thruster, part of a newton
LARGEST_BIAS = 2.0  # [-] of the dead-band; a stronger bias is not worth its power
JUST_OUT = 1.001  # [-] of the dead-band; a margin for rounding
WELL_OUT = 1.25  # [-] of the dead-band; beyond it no bias is needed


class ThrustBias:
    """Sets of thrusters that can push against each other, and whether each set is biased now."""

    def __init__(self, effect: Matrix, dead_bands: Sequence[float], axes: Collection[str]) -> None:
        """
        Args:
            effect: (6, n) wrench per newton; a column of zeros excludes a thruster.
            dead_bands: (n,) [N]
            axes: thrusters that act on any of these are biased.
        """
        self._dead_bands = dead_bands
        rows = [AXES.index(axis) for axis in axes]
        acting = np.any(np.abs(effect[rows]) > LEAST_PART, axis=0)
        self.sets: list[Bias] = [
            [(index, float(bias[index])) for index in np.flatnonzero(bias).tolist()]
            for bias in (biases(effect) if axes else [])
            if np.any(acting & (bias != 0.0))
        ]
        self._on = [False] * len(self.sets)

    def added(self, forces: list[float], limits: Sequence[tuple[float, float]]) -> list[float]:
        """Forces [N] of the same wrench outside the dead-bands, where that is possible.

        Args:
            forces: (n,) [N]
            limits: (n,) [N] lowest and highest of each thruster.
        """
        result = list(forces)
        for number, bias in enumerate(self.sets):
            enough = WELL_OUT if self._on[number] else 1.0
            self._on[number] = any(
                abs(forces[index]) < enough * self._dead_bands[index] for index, _ in bias
            )
            if self._on[number]:
                self._push_apart(result, bias, limits)
        return result

    def _push_apart(
        self, forces: list[float], bias: Bias, limits: Sequence[tuple[float, float]]
    ) -> None:
        """Add the weakest bias that takes every thruster of the set out of its dead-band."""
        strength = max(
            (copysign(JUST_OUT * self._dead_bands[index], part) - forces[index]) / part
            for index, part in bias
        )
        if strength > LARGEST_BIAS * max(self._dead_bands[index] for index, _ in bias):
            return
        pushed = [(index, forces[index] + strength * part) for index, part in bias]
        if all(limits[index][0] <= force <= limits[index][1] for index, force in pushed):
            for index, force in pushed:
                forces[index] = force


def biases(effect: Matrix) -> list[Matrix]:
    """(n,) each: forces without a wrench, one per independent set of thrusters that have one spare
    freedom. The smallest part of each is 1 or -1. Thrusters that cannot be balanced are in none.

    Args:
        effect: (6, n) wrench per newton.
    """
    counts = np.any(np.abs(effect) > LEAST_PART, axis=0)
    # The projector into the null space. Where a set has one freedom, its columns are all along it.
    null = on_any_processor(np.diag(counts.astype(float)) - np.linalg.pinv(effect) @ effect)
    found: list[Matrix] = []
    left = {index for index in range(len(counts)) if null[index, index] > LEAST_PART}
    while left:
        column = null[:, min(left)]
        members = np.flatnonzero(np.abs(column) > LEAST_PART)
        left -= {min(left), *members.tolist()}
        parts = np.abs(column[members])
        one = abs(np.trace(null[np.ix_(members, members)]) - 1.0) < LEAST_PART
        if one and parts.min() >= EVEN * parts.max():
            found.append(np.where(np.abs(column) > LEAST_PART, column, 0.0) / parts.min())
    return found


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
