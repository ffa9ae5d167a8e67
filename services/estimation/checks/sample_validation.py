"""Validation of samples: in range, and from a working sensor."""

from collections.abc import Sequence

from messages import topics
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.vehicle import Actuation
from services.estimation.checks import range_checks
from services.estimation.checks.sensor_watch import SensorWatch, WatchSettings
from services.estimation.checks.thrust_watch import ThrustWatch
from services.marine.vehicle import Thruster


class SampleValidation:
    """One method per sensor: may this sample be used? `events` collects the refusals."""

    def __init__(
        self,
        limits: WatchSettings,
        events: list[str],
        pressure_std: float | None = None,
        thrusters: Sequence[Thruster] = (),
    ) -> None:
        """`pressure_std`: [Pa] declared noise of one sample."""
        self._events = events
        self._thrust = ThrustWatch.of(thrusters)
        rest = limits.imu_frozen_at_rest
        imu, field, pressure, like = (
            topics.IMU,
            topics.MAGNETOMETER,
            topics.PRESSURE,
            limits.rate_tolerance,
        )
        force, rate = limits.accelerometer_noise, limits.gyro_noise
        self._imu = SensorWatch(
            imu.key,
            limits.imu_frozen,
            events,
            imu.hz,
            like,
            noise=(force, force, force, rate, rate, rate),
            at_rest=None if rest is None else (rest, self._thrust),
        )
        self._pressure = SensorWatch(
            pressure.key,
            limits.pressure_frozen,
            events,
            limits.pressure_rate,
            like,
            noise=(limits.pressure_noise,),
            std=pressure_std,
        )
        self._field = SensorWatch(
            field.key,
            limits.magnetometer_frozen,
            events,
            limits.magnetometer_rate,
            like,
            limits.magnetometer_silent,
        )
        self._dvl = SensorWatch(
            topics.DVL.key, limits.dvl_frozen, events, silent_after=limits.dvl_silent
        )
        self._usbl = SensorWatch(
            topics.USBL.key, limits.usbl_frozen, events, silent_after=limits.usbl_silent
        )
        self._all = self._imu, self._pressure, self._field, self._dvl, self._usbl
        self._may_freeze = self._imu, self._pressure, self._field
        self._may_fall_silent = self._field, self._dvl, self._usbl

    def imu(self, sample: ImuSample) -> bool:
        if range_checks.saturated(sample):
            return self._refused("saturated:sensor/imu")
        if not range_checks.imu(sample):
            return self._refused("implausible:sensor/imu")
        content = (*sample.specific_force, *sample.angular_rate)
        return self._imu.usable(content, sample.stamp_ns)

    def actuation(self, sample: Actuation) -> None:
        """Thrust as reported: whether the vehicle may be at rest."""
        self._thrust.see(sample.thrust, sample.stamp_ns)

    def pressure(self, sample: PressureSample) -> bool:
        if not range_checks.pressure(sample):
            return self._refused("implausible:sensor/pressure")
        return self._pressure.usable((sample.pressure,), sample.stamp_ns)

    def magnetometer(self, sample: MagnetometerSample) -> bool:
        if not range_checks.magnetometer(sample):
            return self._refused("implausible:sensor/magnetometer")
        return self._field.usable(sample.field, sample.stamp_ns)

    def dvl(self, sample: DvlSample) -> bool:
        if not range_checks.dvl(sample):
            return self._refused("implausible:sensor/dvl")
        return self._dvl.usable(sample.velocity, sample.stamp_ns)

    def usbl(self, sample: UsblSample) -> bool:
        if not range_checks.usbl(sample):
            return self._refused("implausible:sensor/usbl")
        return self._usbl.usable((sample.north, sample.east), sample.stamp_ns)

    def listen(self, now: int) -> None:
        """Count sensors that have fallen silent. A silent IMU shows in the state, a silent pressure
        sensor in the age of its sample."""
        for watch in self._may_fall_silent:
            watch.listen(now)

    @property
    def troubles(self) -> tuple[str, ...]:
        """Names of the counts that say which sensors cannot be used now, and why."""
        return tuple(why for watch in self._all if (why := watch.trouble) is not None)

    @property
    def frozen(self) -> tuple[str, ...]:
        """Names of the counts of sensors that repeat one value now."""
        return tuple(name for watch in self._may_freeze if (name := watch.frozen) is not None)

    def _refused(self, why: str) -> bool:
        self._events.append(why)
        return False
