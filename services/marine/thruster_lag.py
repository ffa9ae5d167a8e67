"""Thruster lag as a sum of decaying modes, exact for any time step.

A lag G(s) = b(s)/a(s) with G(0) = 1 and distinct poles p has the step response
f(t) = 1 − Σ c exp(p t), with c = −b(p) / (p a'(p)) (partial fractions, Heaviside). So a thruster's
state is its final value and the remaining gap of each mode.
"""

from cmath import exp as complex_exp
from math import exp
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

Coefficient = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
SAME_POLE = 1e-6  # [-] poles closer than this share of their size count as one


class LagMode(NamedTuple):
    """A real pole, or one of a conjugate pair that stands for both: its thrust is the real part."""

    pole: complex  # [1/s]
    share: complex  # [-] c: this mode's initial gap, as a share of the step


class Lag(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """From command to thrust: b(s)/a(s), highest power of s first.

    Raises:
        ValueError: it does not settle at the command, does not follow smoothly, is not stable, or
            has a double pole.
    """

    numerator: Annotated[list[Coefficient], msgspec.Meta(min_length=1, max_length=8)]
    denominator: Annotated[list[Coefficient], msgspec.Meta(min_length=2, max_length=8)]

    def __post_init__(self) -> None:
        b, a = self.numerator, self.denominator
        if a[0] == 0 or len(b) >= len(a):
            raise ValueError(
                "lag: the denominator must begin with a number that is not 0 and be longer than "
                "the numerator, for thrust does not jump"
            )
        if a[-1] == 0 or abs(b[-1] / a[-1] - 1.0) > 1e-9:
            raise ValueError(
                f"lag: thrust must settle at the command, so the last coefficients must be equal "
                f"and not 0, found {b[-1]:g} and {a[-1]:g}"
            )
        poles = np.roots(a)
        if not all(pole.real < 0 for pole in poles):
            raise ValueError("lag: not stable, a pole does not lie left of the imaginary axis")
        apart = [abs(p - q) / abs(p) for i, p in enumerate(poles) for q in poles[:i]]
        if min(apart, default=1.0) < SAME_POLE:
            raise ValueError("lag: two poles are the same; make one a little faster")


def first_order(time_constant: float) -> list[LagMode]:
    """1/(τ s + 1): one mode."""
    return [LagMode(-1.0 / time_constant, 1.0)]


def modes_of(lag: Lag) -> list[LagMode]:
    """Partial fractions; one of each conjugate pair, with twice its share."""
    a, b = np.poly1d(lag.denominator), np.poly1d(lag.numerator)
    slope = a.deriv()
    modes = list[LagMode]()
    for p in np.roots(a):
        share = -complex(b(p) / (p * slope(p)))
        if abs(p.imag) <= SAME_POLE * abs(p):
            modes.append(LagMode(float(p.real), share.real))
        elif p.imag > 0:
            modes.append(LagMode(complex(p), 2 * share))
    return modes


def decay(pole: complex, seconds: float) -> complex:
    """[-] Remaining share of a mode; real for a real pole."""
    return exp(pole * seconds) if isinstance(pole, float) else complex_exp(pole * seconds)
