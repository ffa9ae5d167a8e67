"""Twin clothoids: along a clothoid the curvature changes linearly with the distance.

Source: Fernandes et al. 2015, section 3.3, in closed form: the power series (101), (102) are
Fresnel integrals.
"""

from math import pi, sqrt

from services.reference.paths.turn import Turn, TurnPoint

SMALLEST = 1e-17  # relative; smaller terms of a series change nothing


def fresnel(z: float) -> tuple[float, float]:
    """C(z), S(z): the integrals of cos(π t²/2) and sin(π t²/2) from 0 to z.

    Power series, to 1e-15 for |z| ≤ 1.5 (a turn needs |z| ≤ 1).

    Raises:
        ValueError: |z| > 1.5, where the series loses digits.
    """
    if not abs(z) <= 1.5:
        raise ValueError(f"z: found {z}, the series is good for -1.5 to 1.5")
    square = pi * z * z / 2
    c = s = 0.0
    power, n = z, 0  # z (π z²/2)ⁿ / n!: even n belong to C, odd n to S
    while abs(power) > SMALLEST * abs(z):
        term = power / (2 * n + 1) * (1 if n % 4 < 2 else -1)
        c, s = (c + term, s) if n % 2 == 0 else (c, s + term)
        n += 1
        power *= square / n
    return c, s


class TwinClothoids(Turn):
    """The turn of Fernandes et al. 2015, even parity: the curvature rises linearly to 1/r in the
    middle and falls linearly back to 0."""

    name = "clothoids"

    def first_half(self, s: float) -> TurnPoint:
        half = self.length / 2
        u, scale = s / half, sqrt(pi / self.angle)
        c, integral_s = fresnel(u / scale)
        return TurnPoint(
            half * scale * c,
            half * scale * integral_s,
            self.angle * u * u / 2,
            u / self.min_radius,
            1 / (self.min_radius * half),
        )
