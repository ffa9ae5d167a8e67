"""The deviation of the compass, and when the compass is corrected by it.

What a vehicle's own iron adds to the Earth's field turns with the vehicle, and so does an error of
tilt, which lets a share of the steep field in. Both bend the compass by

    A + B sin ψ + C cos ψ      ψ: heading by the compass

which are the first coefficients of a ship's deviation card. With a DVL and acoustic fixes they show
as soon as the vehicle goes somewhere: the way it went over the ground by its own account is turned
against the way between the fixes. The horizontal filter estimates them; here is what is told of it.

What DVL and positioning system have in common cannot be told from deviation: a DVL or a transducer
that is mounted askew. Place and heading then agree with each other, in the fixes' own directions.
"""

from math import cos, exp, hypot, radians, sin
from typing import NamedTuple

KNOWN = radians(1.5)  # [rad] a deviation known less well than this is not followed
LAG = 15.0  # [s] after which most of it is: the coefficients are steadier than what is seen of them
FADE = 60.0  # [s] in which it is forgotten when the place is lost
FORGOTTEN = 1e-4  # [rad] so little is none
MOST = 0.2  # [rad] a larger deviation is not corrected: that compass wants adjusting


class Coefficients(NamedTuple):
    """[rad] What is to be added to the compass, with the signs of the error of heading."""

    A: float = 0.0
    B: float = 0.0
    C: float = 0.0

    def at(self, heading: float) -> float:
        """[rad] For a heading [rad] by the compass."""
        return self.A + self.B * sin(heading) + self.C * cos(heading)

    def towards(self, goal: "Coefficients", share: float) -> "Coefficients":
        """This share [-] of the way."""
        a, b, c = (old + share * (new - old) for old, new in zip(self, goal, strict=True))
        return Coefficients(a, b, c)

    @property
    def largest(self) -> float:
        """[rad] At any heading, at most."""
        return abs(self.A) + hypot(self.B, self.C)


NONE = Coefficients()


class CompassDeviation:
    """Follows what the filter sees while that is worth it, holds it while it is not, and forgets it
    when the place is lost."""

    __slots__ = ("_limited", "_spread", "told")

    def __init__(self) -> None:
        self.told = NONE
        self._spread: float | None = None  # [rad] of the corrected heading; None: not followed
        self._limited = False

    def follow(self, seen: Coefficients, std: float, heading: float, dt: float) -> str | None:
        """After another `dt` [s], with the spread [rad] of what is seen for this heading [rad].
        Returns what is to be counted."""
        if std > KNOWN:
            self._spread = None
            return None
        event = None
        if seen.largest > MOST:
            event = None if self._limited else "limited:deviation"
            share = MOST / seen.largest
            seen = Coefficients(*(share * each for each in seen))
            self._limited = True
        else:
            self._limited = False
        self.told = self.told.towards(seen, 1.0 - exp(-dt / LAG))
        self._spread = hypot(std, self.told.at(heading) - seen.at(heading))
        return event

    def hold(self) -> None:
        """The aids say too little at the moment."""
        self._spread = None

    def forget(self, dt: float) -> None:
        """Without a place for another `dt` [s]."""
        self.hold()
        if self.told == NONE:
            return
        if self.told.largest < FORGOTTEN:
            self.told = NONE
            return
        self.told = self.told.towards(NONE, 1.0 - exp(-dt / FADE))

    def corrected_std(self, std: float) -> float:
        """[rad] Of the corrected heading, where the compass alone has this one."""
        return std if self._spread is None else min(std, self._spread)
