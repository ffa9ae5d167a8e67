"""How far the vehicle has turned while there were no IMU samples: the compass says.

The gyroscope measures turns, not the heading. After a silence in which the vehicle may have turned
far, the heading is unknown until the magnetometer has measured the normal field for a while.
"""

from services.estimation.attitude.heading import UNKNOWN_TURN, wrapped

MOST = 0.2  # [rad] possible unseen turn that the heading's std alone may say
MEASURED_FOR = 1.0  # [s] of the mean


class UnseenTurn:
    """`matters` from a long silence on, until the heading has been measured."""

    __slots__ = ("_first", "_rest", "_samples", "_seconds", "_turn")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The heading is known."""
        self._turn = 0.0  # [rad] possible
        self._begin()

    def _begin(self) -> None:
        self._first: float | None = None  # [rad] first offset measured
        self._rest, self._samples = 0.0, 0  # [rad] sum of the differences from it
        self._seconds = 0.0  # [s] since then

    @property
    def matters(self) -> bool:
        return self._turn > MOST

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self._turn += UNKNOWN_TURN * seconds
        self._begin()

    def measure(self, offset: float | None, dt: float) -> float | None:
        """Take in the offset [rad] from control to magnetic heading, `dt` [s] after the last one;
        None: the field is not the normal one. Returns their mean [rad] once it is known."""
        if offset is None:
            self._begin()
            return None
        if self._first is None:
            self._first = offset
        else:
            self._seconds += dt
        self._rest += wrapped(offset - self._first)
        self._samples += 1
        if self._seconds < MEASURED_FOR:
            return None
        return wrapped(self._first + self._rest / self._samples)
