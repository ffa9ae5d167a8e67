"""Calibration before the dive: the vehicle floats at rest, and the pilot sees the time left."""

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
    """Runs the calibration; `events` gets what it waits for."""

    def __init__(self, settings: CalibrationSettings, events: Events) -> None:
        self._calibration = Calibration(settings)
        self._countdown = Countdown()
        self._events = events
        self._pressure_warned = False

    def imu(self, sample: ImuSample, dt: float) -> Calibrated | None:
        """One sample, `dt` [s] after the previous one. Returns the result once it is complete."""
        calibration, events = self._calibration, self._events
        if calibration.imu(sample.angular_rate, sample.specific_force, dt):
            events.note("moved:calibration")
            events.warn("the vehicle moves: calibration waits until it is still")
            self._countdown = Countdown()
        result = calibration.result()
        if result is not None:
            return result
        if calibration.lacks_pressure and not self._pressure_warned:
            self._pressure_warned = True
            events.note("waiting:sensor/pressure")
            events.warn("calibration waits for the pressure sensor")
        elif (line := self._countdown.line(calibration.seconds_left)) is not None:
            events.say(line)
        return None

    def pressure(self, pressure: float) -> None:
        """One validated sample [Pa]."""
        self._calibration.pressure(pressure)

    def magnetometer(self, field: Vec3) -> None:
        """One validated sample [T], FRD."""
        self._calibration.magnetometer(field)

    @property
    def seconds_left(self) -> float:
        """[s] of rest still needed."""
        return self._calibration.seconds_left
