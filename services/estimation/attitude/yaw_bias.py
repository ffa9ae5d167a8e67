"""The gyroscope's bias about the vertical, learnt anew in motion from the magnetometer.

Gravity says nothing about a turn about the vertical. The magnetometer does, whatever the vehicle
does: the offset from the gyroscope's heading to the magnetic one is constant if the bias is right.
A proportional and an integral correction (Mahony et al. 2008, eq. 48) follow the offset and move
the bias until it is.
"""

from services.estimation.attitude.heading import wrapped

SPRING, INTEGRAL = 1.0, 0.25  # [1/s], [1/s²] critically damped
MEMORY = 1.0  # [s] of the mean innovation
AGREED, AGREED_FOR = 0.02, 4.0  # [rad], [s] of the mean: learnt


class YawBias:
    """From the moment the gyroscope is doubted until it is trusted again."""

    __slots__ = ("_agreed_for", "_mean", "offset")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self.offset: float | None = None  # [rad] magnetic minus control heading; None: not measured
        self._mean = 0.0  # [rad]
        self._agreed_for = 0.0  # [s]

    @property
    def learnt(self) -> bool:
        return self._agreed_for >= AGREED_FOR

    def miss(self) -> None:
        """A sample whose field is not the Earth's, as the attitude says: no agreement."""
        self._agreed_for = 0.0

    def step(self, measured: float, dt: float) -> float:
        """Take in an offset [rad] measured `dt` [s] after the last one. Returns the change of the
        bias [rad/s] about the body's z."""
        if self.offset is None:
            self.offset = wrapped(measured)
            return 0.0
        innovation = wrapped(measured - self.offset)
        self.offset = wrapped(self.offset + SPRING * innovation * dt)
        self._mean += min(1.0, dt / MEMORY) * (innovation - self._mean)
        self._agreed_for = self._agreed_for + dt if abs(self._mean) < AGREED else 0.0
        return -INTEGRAL * innovation * dt
