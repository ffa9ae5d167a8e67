"""Sums over one filter interval, at the IMU's rate."""

from services.estimation.horizontal.horizontal_filter import Pair


class OpenInterval:
    """An interval not yet closed. One sample without acceleration or force makes that quantity
    unknown for the whole interval."""

    __slots__ = ("_force", "_gained", "_turned", "seconds")

    def __init__(self) -> None:
        self.seconds = 0.0
        self._gained: Pair | None = (0.0, 0.0)  # [m/s] north, east
        self._force: Pair | None = (0.0, 0.0)  # [N s] surge, sway
        self._turned = 0.0  # [rad]

    def add(
        self, dt: float, acceleration: Pair | None, yaw_rate: float, force: Pair | None
    ) -> None:
        """Add `dt` [s] with this acceleration [m/s²], yaw rate [rad/s] and thrust [N]."""
        self.seconds += dt
        self._turned += yaw_rate * dt
        self._gained = _sum(self._gained, acceleration, dt)
        self._force = _sum(self._force, force, dt)

    @property
    def gained(self) -> Pair | None:
        """[m/s] Change of velocity, north and east, lean included; None: IMU silent."""
        return self._gained

    @property
    def acceleration(self) -> Pair | None:
        """[m/s²] Mean, north and east, lean included; None: IMU silent."""
        return _mean(self._gained, self.seconds)

    @property
    def force(self) -> Pair | None:
        """[N] Mean, surge and sway; None: unknown."""
        return _mean(self._force, self.seconds)

    @property
    def yaw_rate(self) -> float:
        """[rad/s] Mean."""
        return self._turned / self.seconds if self.seconds > 0.0 else 0.0


def _sum(total: Pair | None, rate: Pair | None, dt: float) -> Pair | None:
    if total is None or rate is None:
        return None
    return total[0] + rate[0] * dt, total[1] + rate[1] * dt


def _mean(total: Pair | None, seconds: float) -> Pair | None:
    if total is None or seconds <= 0.0:
        return None
    return total[0] / seconds, total[1] / seconds
