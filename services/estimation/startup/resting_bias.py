"""Updates of the gyroscope bias while the vehicle is at rest.

Start-up averaging leaves an error of noise / √seconds, and the bias drifts. A vehicle that still
floats, or lies on the sea floor, measures its bias as well as at start-up. Thrusters and moving
water exceed the sensor's own noise, so only true rest is averaged.

A steady turn slower than `rest_change` cannot be told from a bias; so the average is slow.
"""

from messages.units import Vec3
from services.estimation.startup.calibration import BLOCK, CalibrationSettings, Mean


class RestingBias:
    """A running mean of the rate at rest, in blocks of half a second.

    A block counts only if the next one is at rest too, because motion begins slowly.
    """

    def __init__(self, settings: CalibrationSettings, bias: Vec3) -> None:
        """Start with this bias [rad/s], with the weight of the calibration."""
        self.bias = bias
        self._settings = settings
        self._known_for = settings.still_time  # [s] of rest in the mean
        self._still_for = settings.rest_time  # [s] calibration has just seen rest
        self._block, self._seconds = Mean(6), 0.0
        self._waiting: Vec3 | None = None  # mean of the block before

    def imu(self, rate: Vec3, specific_force: Vec3, dt: float) -> str | None:
        """One sample, bias included [rad/s, m/s²]. Returns an event to count."""
        self._seconds += dt
        self._block.add((*rate, *specific_force))
        if self._block.count < BLOCK:
            return None
        block, seconds = self._block, self._seconds
        self._block, self._seconds = Mean(6), 0.0
        p, q, r, *_ = block.mean()
        if not self._is_still(block, (p, q, r)):
            self._still_for, self._waiting = 0.0, None
            return None
        began = self._still_for < self._settings.rest_time
        self._still_for += seconds
        if self._still_for < self._settings.rest_time:
            return None
        if self._waiting is not None:
            self._learn(self._waiting, seconds)
        self._waiting = (p, q, r)
        return "resting:gyro_bias" if began else None

    def relearn(self, bias: Vec3) -> None:
        """Go on with another bias [rad/s], with the weight of the calibration."""
        self.bias, self._known_for = bias, self._settings.still_time
        self.moved()

    def moved(self) -> None:
        """A gap in the samples counts as motion."""
        self._block, self._seconds = Mean(6), 0.0
        self._still_for, self._waiting = 0.0, None

    def _learn(self, mean: Vec3, seconds: float) -> None:
        self._known_for = min(self._settings.rest_memory, self._known_for + seconds)
        share, (a, b, c), (p, q, r) = seconds / self._known_for, self.bias, mean
        self.bias = (a + share * (p - a), b + share * (q - b), c + share * (r - c))

    def _is_still(self, block: Mean, mean: Vec3) -> bool:
        s = self._settings
        spread = block.std()
        if max(spread[:3]) > s.rest_rate_std or max(spread[3:]) > s.rest_force_std:
            return False
        change = max(abs(new - old) for new, old in zip(mean, self.bias, strict=True))
        return change <= s.rest_change and max(map(abs, mean)) <= s.largest_bias
