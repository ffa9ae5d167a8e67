"""The deviation of the compass, and when the compass is corrected by it.

The field of a vehicle's own iron turns with the vehicle, and so does a tilt error, which adds a
share of the steep field. Both deflect the compass by

    A + B sin ψ + C cos ψ      ψ: heading by the compass

which are the first coefficients of a ship's deviation card. With a DVL and acoustic fixes they are
observable as soon as the vehicle moves: its dead-reckoned track is rotated against the fixes. The
horizontal filter estimates them; this module decides which correction is published.

A DVL or transducer mounted at a wrong angle cannot be told from deviation. Position and heading are
then consistent with each other, in the fixes' frame.
"""

from math import cos, exp, hypot, radians, sin
from typing import NamedTuple

from messages import events
from messages.events import Event

KNOWN = radians(1.5)  # [rad] a deviation with a larger std is not followed
LAG = 15.0  # [s] low-pass: the coefficients vary less than their estimates
FADE = 60.0  # [s] time constant of the decay without a position
FORGOTTEN = 1e-4  # [rad] a smaller deviation counts as none
MOST = 0.2  # [rad] the correction is limited to this: that compass needs adjustment


class Coefficients(NamedTuple):
    """[rad] Corrections to add to the compass heading."""

    A: float = 0.0
    B: float = 0.0
    C: float = 0.0

    def at(self, heading: float) -> float:
        """[rad] For a heading [rad] by the compass."""
        return self.A + self.B * sin(heading) + self.C * cos(heading)

    def towards(self, goal: "Coefficients", share: float) -> "Coefficients":
        """Interpolation by this share [-]."""
        a, b, c = (old + share * (new - old) for old, new in zip(self, goal, strict=True))
        return Coefficients(a, b, c)

    @property
    def largest(self) -> float:
        """[rad] Upper bound over all headings."""
        return abs(self.A) + hypot(self.B, self.C)


NONE = Coefficients()


class CompassDeviation:
    """Follows the filter's estimate while it is accurate, holds it while it is not, and lets it
    decay when the position is lost."""

    __slots__ = ("_limited", "_std", "correction", "used")

    def __init__(self) -> None:
        self.correction = NONE
        self.used = False  # followed at least once, and not forgotten since
        self._std: float | None = None  # [rad] of the corrected heading; None: not followed
        self._limited = False

    def follow(self, estimate: Coefficients, std: float, heading: float, dt: float) -> Event | None:
        """Follow for `dt` [s] an estimate with this std [rad] at this heading [rad]. Returns an
        event to tell."""
        if std > KNOWN:
            self._std = None
            return None
        event, self.used = None, True
        if estimate.largest > MOST:
            event = None if self._limited else events.LIMITED("deviation")
            share = MOST / estimate.largest
            estimate = Coefficients(*(share * each for each in estimate))
            self._limited = True
        else:
            self._limited = False
        self.correction = self.correction.towards(estimate, 1.0 - exp(-dt / LAG))
        self._std = hypot(std, self.correction.at(heading) - estimate.at(heading))
        return event

    def hold(self) -> None:
        """Keep the correction; the estimate is not updated."""
        self._std = None

    def forget(self, dt: float) -> None:
        """Let the correction decay for `dt` [s] without a position."""
        self.hold()
        if self.correction.largest < FORGOTTEN:
            self.correction, self.used = NONE, False
            return
        self.correction = self.correction.towards(NONE, 1.0 - exp(-dt / FADE))

    def corrected_std(self, std: float) -> float:
        """[rad] Std of the corrected heading, for this std of the compass alone."""
        return std if self._std is None else min(std, self._std)
