"""Numbers of many dives at once: an array with one number for each, its lane. What is the same in
all of them may be a plain float.

Laws of the services that neither branch nor call `math` are used as they are; the others are
written again here, and tests hold each against the scalar law.
"""

from typing import Any, cast

import numpy as np

# Arrays (lanes,) or (…, lanes). They have no type of their own, because laws that are typed for
# floats take them as well.
Lanes = Any
Mask = Any  # of booleans
Lanes3 = Any  # a tuple of three, four or six of them, as the scalar laws have of floats
Lanes4 = Any
Lanes6 = Any


def where(which: Mask, yes: Any, no: Any) -> Any:
    return cast(Any, np.where(which, yes, no))


def clamped(value: Lanes, most: Any) -> Lanes:
    return np.maximum(-most, np.minimum(most, value))


def total(columns: Any, values: Lanes) -> Lanes:
    """`columns` (rows, n) times `values` (n, lanes), added up in this order, as `total_wrench`
    does: opposite thrusts then cancel out to the last bit."""
    found: Lanes = columns[:, 0, None] * values[0]
    for k in range(1, len(values)):
        found = found + columns[:, k, None] * values[k]
    return found


def unit(w: Lanes, x: Lanes, y: Lanes, z: Lanes) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """The quaternion with length 1."""
    size = np.sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


def to_euler(q: Lanes4) -> tuple[Lanes, Lanes, Lanes]:
    """Roll, pitch and heading [rad], see services/marine/attitude.py."""
    w, x, y, z = q
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(clamped(2 * (w * y - x * z), 1.0))
    return roll, pitch, np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def wrapped(angle: Lanes) -> Lanes:
    """The same angle [rad] in -π … π."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
