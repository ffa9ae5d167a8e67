"""Sensor samples. From `simulator` or a vehicle driver; received by `estimation`.

`stamp_ns` is the sample's time of validity. Values are in the sensor's own axes, at the sensor's
own position. Both are the vehicle's, FRD (forward, starboard, down), unless the vehicle file has a
[vehicle.mounting].
"""

from messages.message import Message
from messages.units import Finite, NotNegative, Vec3


class ImuSample(Message, frozen=True, kw_only=True):
    """Accelerometer and gyroscope."""

    specific_force: Vec3  # [m/s²]; in body axes at rest (0, 0, -g)
    angular_rate: Vec3  # [rad/s]


class MagnetometerSample(Message, frozen=True, kw_only=True):
    """Magnetic field, including that of the vehicle itself."""

    field: Vec3  # [T]


class PressureSample(Message, frozen=True, kw_only=True):
    """Absolute pressure at the sensor."""

    pressure: NotNegative  # [Pa] absolute
    temperature: Finite | None = None  # [°C] of the water


class DvlSample(Message, frozen=True, kw_only=True):
    """Doppler velocity log: velocity over the ground."""

    velocity: Vec3 | None  # [m/s] of the sensor; None: no lock on the bottom
    std: NotNegative  # [m/s] one standard deviation of each component, as the device reports it
    altitude: NotNegative | None = None  # [m] above the bottom


class AltitudeSample(Message, frozen=True, kw_only=True):
    """Altimeter, such as an echo sounder that looks down."""

    altitude: NotNegative  # [m] above the bottom


class UsblSample(Message, frozen=True, kw_only=True):
    """Acoustic position fix of the transponder. `stamp_ns` is the time of the position, not of the
    fix's arrival."""

    north: Finite  # [m] NED
    east: Finite  # [m] NED
    std: NotNegative  # [m] one standard deviation of each component


class BatterySample(Message, frozen=True, kw_only=True):
    """Battery voltage, current and energy used."""

    voltage: NotNegative  # [V]
    current: Finite | None  # [A] + out of the battery; None: not measured
    used_wh: NotNegative | None  # [Wh] since power-on; None: not measured
    capacity_wh: NotNegative | None = None  # [Wh] when full; None: unknown to the driver

    @property
    def charge(self) -> float | None:
        """[-] What is left: 1 when full, below 0 where more was used than it should hold; None: the
        driver does not know the capacity."""
        if not self.capacity_wh or self.used_wh is None:
            return None
        return 1.0 - self.used_wh / self.capacity_wh


class LeakSample(Message, frozen=True, kw_only=True):
    """Leak detector inside the enclosure."""

    wet: bool | None  # None: the detector does not answer


class TemperatureSample(Message, frozen=True, kw_only=True):
    """Temperature inside the enclosure, and of the water around it."""

    temperature: Finite  # [°C] inside
    water: Finite | None = None  # [°C] as the depth sensor measures it; None: it does not
