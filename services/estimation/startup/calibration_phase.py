"""The time before the dive: the vehicle floats at rest, and the pilot is told how long it takes."""

from messages.sensors import ImuSample
from messages.units import Vec3
from services.estimation.events import Events
from services.estimation.startup.calibration import (
    Calibrated,
    Calibration,
    CalibrationSettings,
    Countdown,
)


class CalibrationPhase:
    """Hears the sensors until it has learnt enough of them; the journal says what it waits for."""

    def __init__(self, settings: CalibrationSettings, events: Events) -> None:
        self._calibration = Calibration(settings)
        self._countdown = Countdown()
        self._events = events
        self._asked_for_pressure = False

    def imu(self, sample: ImuSample, dt: float) -> Calibrated | None:
        """One sample, `dt` [s] after the one before. What was learnt, once there is enough."""
        calibration, events = self._calibration, self._events
        if calibration.imu(sample.angular_rate, sample.specific_force, dt):
            events.note("moved:calibration")
            events.warn("the vehicle moves: calibration waits until it is still")
            self._countdown = Countdown()
        learnt = calibration.result()
        if learnt is not None:
            return learnt
        if calibration.lacks_pressure and not self._asked_for_pressure:
            self._asked_for_pressure = True
            events.note("waiting:sensor/pressure")
            events.warn("calibration waits for the pressure sensor")
        elif (line := self._countdown.line(calibration.seconds_left)) is not None:
            events.say(line)
        return None

    def pressure(self, pressure: float) -> None:
        """One usable sample [Pa]."""
        self._calibration.pressure(pressure)

    def magnetometer(self, field: Vec3) -> None:
        """One usable sample [T], FRD."""
        self._calibration.magnetometer(field)

    @property
    def seconds_left(self) -> float:
        """[s] of rest still to come."""
        return self._calibration.seconds_left
