"""The axes that a layout of thrusters can drive, each independently of the others.

The test is stricter than rank: an axis counts as driven when it costs at most `MOST_COST` newtons
of thrust per newton of force with all other driven axes at zero. Two thrusters on the same line
count once; a lever arm of a few millimetres does not count.
"""

from collections.abc import Iterable, Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from services.marine.vehicle import Vehicle, wrench_per_newton

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
