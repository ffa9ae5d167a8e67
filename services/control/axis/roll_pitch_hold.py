"""Roll or pitch held level by a spring and a damper."""

from dataclasses import dataclass

import msgspec

from messages.message import Estimate
from messages.units import NotNegativeSetting, Ns


class RollPitchGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Roll or pitch held at zero, if the thrusters can drive it. 0, 0: hydrostatic only."""

    kp: NotNegativeSetting = 0.0  # [N m/rad]
    kd: NotNegativeSetting = 0.0  # [N m s/rad]


@dataclass(slots=True)
class RollPitchHold:
    gains: RollPitchGains
    _angle: float = 0.0  # [rad] at the last step
    _at: Ns | None = None  # [ns] stamp of its sensor sample; None: not known
    rate: float = 0.0  # [rad/s] of the angle; 0 while it is not known

    def step(self, angle: Estimate, sensor_ns: Ns) -> float:
        """Moment [N m]. The rate is the difference of two angles of the attitude filter, which
        integrates the gyroscope and so adds little noise."""
        if not angle.valid:
            self.forget()
            return 0.0
        if self._at is None:
            self.rate = 0.0
        elif sensor_ns > self._at:
            self.rate = (angle.value - self._angle) / ((sensor_ns - self._at) * 1e-9)
        self._angle, self._at = angle.value, sensor_ns
        return -self.gains.kp * angle.value - self.gains.kd * self.rate

    def forget(self) -> None:
        """Restart the rate with the next sample."""
        self._at, self.rate = None, 0.0
