"""Wrapping of angles at ±π."""

from math import pi, remainder


def wrap(angle: float) -> float:
    """The same direction in (−π, π] [rad]."""
    wrapped = remainder(angle, 2 * pi)
    return pi if wrapped == -pi else wrapped
