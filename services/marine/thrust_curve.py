"""Thrust of a propeller as a function of voltage, and the inverse, for its driver.

Commands are in newtons, and the driver inverts the curve. Two properties remain: the largest
thrust, and the dead-band in the middle where the motor does not turn.
"""

from collections.abc import Callable
from typing import NamedTuple

HALVINGS = 60  # of the interval 0 … 1: more than a float has digits


class ThrustCurve(NamedTuple):
    """Odd in the voltage, and rising up to `top`."""

    thrust: Callable[[float], float]  # [N] for a share of the voltage, -1 … 1
    top: float  # [-] share of the voltage beyond which thrust no longer grows
    silent: float  # [-] any smaller share does not turn the motor

    def share(self, newtons: float) -> float:
        """[-] Share of the voltage for this thrust, limited to `top`.

        By bisection: the polynomial has no inverse in closed form.
        """
        low, high = 0.0, self.top
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.thrust(middle) < abs(newtons) else (low, middle)
        return high if newtons >= 0 else -high

    @property
    def most(self) -> float:
        """[N]"""
        return self.thrust(self.top)

    @property
    def dead_band(self) -> float:
        """[N] Thrust at the edge of the dead-band."""
        return self.thrust(self.silent)


def t200(share: float) -> float:
    """[N] A Blue Robotics T200 at 16 V, identified by von Benzon et al. 2022 (doi
    10.3390/jmse10121898): -140.3 V⁹ + 389.9 V⁷ - 404.1 V⁵ + 176 V³ + 8.9 V."""
    square = share * share
    return share * (8.9 + square * (176.0 + square * (-404.1 + square * (389.9 - 140.3 * square))))


def ardusub_simulator(share: float) -> float:
    """[N] A motor of the simulator that comes with ArduSub's firmware: quadratic."""
    return 51.48 * share * abs(share)


def ardusub_simulator_plane(share: float) -> float:
    """[N] The same along its axis, where that is diagonal: as much forward as to the side."""
    return 2.0**0.5 * ardusub_simulator(share)


# The polynomial has its maximum at 97.2 %; the decrease beyond, 0.2 N, is an artefact of the fit.
# The ESC does not turn for pulses of 1464 to 1532 µs of 1100 to 1900 (a public fit), and that of
# ArduSub's simulator for 1475 to 1525.
CURVES: dict[str, ThrustCurve] = {
    "t200": ThrustCurve(t200, top=0.9716, silent=0.085),
    "ardusub_simulator": ThrustCurve(ardusub_simulator, top=1.0, silent=0.0625),
    "ardusub_simulator_plane": ThrustCurve(ardusub_simulator_plane, top=1.0, silent=0.0625),
}
LINEAR = "linear"  # no curve: limits and dead-band are those of the vehicle file
