"""What is asked of the reference model of Fernandes et al. 2015 (Table 1), and if it is sound."""

from dataclasses import dataclass
from math import copysign, exp, isfinite

SMALLEST, LARGEST = 1e-9, 1e9  # of every length, speed and time: beyond, floats lose the motion


@dataclass(frozen=True, slots=True)
class MotionRequest:
    """One motion along a line. Metres or radians; a motion backwards has a negative cruise velocity
    (as in the paper), a negative length, or both.

    Speeds between 0 and `cruise` have its sign.
    """

    length: float  # L, ≠ 0
    cruise: float  # V_d, per s, ≠ 0; reached where the length allows it
    accel_time: float  # T_a [s] > 0 from 0 to cruise, at least
    decel_time: float  # T_d [s] > 0 from cruise to 0, at least
    initial: float = 0.0  # V_i, per s, 0 to cruise
    final: float = 0.0  # V_f, per s, 0 to cruise
    epsilon: float = 0.05  # ε_L [-] 0 to 0.1, least fraction of the length at constant speed
    theta_a: float = 0.8  # θ_a [-] 0.6 to < 1, speed fraction at which the acceleration fades out
    theta_d: float = 0.2  # θ_d [-] > 0 to 0.4, the same for the deceleration
    theta_0: float = exp(-100 / 9)  # θ_0 [-] 1e-6 to 1e-3, where the exponentials are cut off
    xi_a: float = 15.0  # ξ_a [-] 10 to 15, steepness of the start of the acceleration
    xi_d: float = 15.0  # ξ_d [-] 10 to 15, the same for the deceleration

    @property
    def direction(self) -> float:
        """1 forwards, −1 backwards."""
        return -1.0 if self.length < 0 or self.cruise < 0 else 1.0

    def check(self) -> None:
        """Raises ValueError: a value is not allowed."""
        for name in ("length", "cruise"):
            size = abs(getattr(self, name))
            _within(name, getattr(self, name), SMALLEST <= size <= LARGEST, "a size of 1e-9 to 1e9")
        for name in ("accel_time", "decel_time"):
            value = getattr(self, name)
            _within(name, value, SMALLEST <= value <= LARGEST, "1e-9 to 1e9 s, more than 0")
        for name in ("initial", "final"):
            self._check_speed(name, getattr(self, name))
        _within("epsilon", self.epsilon, 0 <= self.epsilon <= 0.1, "0 to 0.1")
        _within("theta_a", self.theta_a, 0.6 <= self.theta_a < 1, "0.6 to less than 1")
        _within("theta_d", self.theta_d, 0 < self.theta_d <= 0.4, "more than 0 to 0.4")
        _within("theta_0", self.theta_0, 1e-6 <= self.theta_0 <= 1e-3, "1e-6 to 1e-3")
        _within("xi_a", self.xi_a, 10 <= self.xi_a <= 15, "10 to 15")
        _within("xi_d", self.xi_d, 10 <= self.xi_d <= 15, "10 to 15")

    def _check_speed(self, name: str, value: float) -> None:
        along = value == 0 or copysign(1.0, value) == copysign(1.0, self.cruise)
        allowed = f"0 to the cruise velocity {self.cruise:g}"
        _within(name, value, along and abs(value) <= abs(self.cruise), allowed)


def _within(name: str, value: float, good: bool, allowed: str) -> None:
    if not (good and isfinite(value)):
        raise ValueError(f"{name} is {value:g}, expected {allowed}")
