"""Does the vehicle move, so that an IMU must say something new?"""

from collections.abc import Sequence
from dataclasses import dataclass

from services.marine.summation import plain_sum
from services.marine.vehicle import Thruster

# [-] of all thrust that there is: 1 % of a BlueROV2's is 2.4 N, eight steps of an accelerometer of
# 1 mg; for as long as it does not change the vehicle may be at rest.
NOTICEABLE = 0.01


@dataclass(slots=True)
class ThrustWatch:
    """When the thrust changed last by so much that the vehicle moves otherwise than before."""

    _noticeable: float  # [N] sum over all thrusters
    _thrust: Sequence[float]  # [N] per thruster, when it changed last
    changed_ns: int | None = None

    @classmethod
    def of(cls, thrusters: Sequence[Thruster]) -> "ThrustWatch":
        most = plain_sum([thruster.max_thrust for thruster in thrusters])
        return cls(NOTICEABLE * most, [0.0] * len(thrusters))

    def see(self, thrust: Sequence[float], stamp_ns: int) -> None:
        """[N] Per thruster, as reported; a report of another length is left alone."""
        if len(thrust) != len(self._thrust):
            return
        change = plain_sum([abs(a - b) for a, b in zip(thrust, self._thrust, strict=True)])
        if change > self._noticeable:
            self._thrust, self.changed_ns = thrust, stamp_ns
