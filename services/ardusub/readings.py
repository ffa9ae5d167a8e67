"""From the board's telemetry to sensor samples, in SI units and body axes."""

from collections.abc import Hashable
from dataclasses import dataclass
from math import isfinite
from typing import Any

from messages.sensors import BatterySample, ImuSample, MagnetometerSample, PressureSample
from messages.units import Ns, Vec3

G = 9.80665  # [m/s²] of a milli-g
TESLA_PER_GAUSS = 1e-4
TEXT, MOST_TEXT = 50, 1000  # characters of one STATUSTEXT; of a long one, that is shown as it is
# Builds on the way to 4.7 multiply milligauss by 1000 in HIGHRES_IMU, where they should divide.
MISSCALED, TOO_MUCH = 1e-6, 1000.0  # [-] and [G] more than a compass measures
IMU_MESSAGES = ("HIGHRES_IMU", "RAW_IMU")  # best first; the first is new in 4.8
PRESSURE_MESSAGE, BATTERY_MESSAGE = "SCALED_PRESSURE2", "SYS_STATUS"
ENCLOSURE_MESSAGE, ENCLOSURE_HZ = "SCALED_PRESSURE", 1.0  # the barometer inside
MESSAGES = (*IMU_MESSAGES, PRESSURE_MESSAGE, BATTERY_MESSAGE, ENCLOSURE_MESSAGE)


PERIOD_NS = 100_000_000  # [ns] between two values of the depth sensor, and of the compass


def stamp_of(fields: dict[str, Any]) -> Ns | None:
    """[ns] Of the board's clock; None in a message without one."""
    if "time_usec" in fields:
        return int(fields["time_usec"]) * 1000
    if "time_boot_ms" in fields:
        return int(fields["time_boot_ms"]) * 1_000_000
    return None


def imu(name: str, fields: dict[str, Any], stamp_ns: Ns) -> ImuSample | None:
    """None where a number is not finite."""
    fine = name == "HIGHRES_IMU"
    force = _vector(fields, "acc", 1.0 if fine else 1e-3 * G)
    rate = _vector(fields, "gyro", 1.0 if fine else 1e-3)
    if force is None or rate is None:
        return None
    return ImuSample(stamp_ns=stamp_ns, specific_force=force, angular_rate=rate)


def field_of(fields: dict[str, Any]) -> Vec3:
    """What an IMU message says of the compass, in its own unit."""
    return fields["xmag"], fields["ymag"], fields["zmag"]


def magnetometer(name: str, fields: dict[str, Any], stamp_ns: Ns) -> MagnetometerSample | None:
    gauss = 1.0 if name == "HIGHRES_IMU" else 1e-3
    if name == "HIGHRES_IMU" and max(map(abs, field_of(fields))) > TOO_MUCH:
        gauss = MISSCALED
    field = _vector(fields, "mag", gauss * TESLA_PER_GAUSS)
    return None if field is None else MagnetometerSample(stamp_ns=stamp_ns, field=field)


def pressure(fields: dict[str, Any], stamp_ns: Ns) -> PressureSample | None:
    pascal = 100.0 * fields["press_abs"]
    if not isfinite(pascal) or not 0.0 <= pascal < 1e9:
        return None
    celsius = fields["temperature"] / 100.0
    return PressureSample(stamp_ns=stamp_ns, pressure=pascal, temperature=celsius)


class BatteryMeter:
    """The board knows voltage and current; the energy is summed up here."""

    def __init__(self) -> None:
        self.power = 0.0  # [W]
        self._used_wh = 0.0
        self._at: Ns | None = None

    def sample(self, fields: dict[str, Any], now: Ns) -> BatterySample | None:
        """None without a battery monitor."""
        voltage = fields["voltage_battery"] / 1000.0
        if not 0.0 < voltage < 65.0:
            return None
        current = max(0.0, fields["current_battery"] / 100.0)  # -1: not measured
        self.power = voltage * current
        if self._at is not None:
            self._used_wh += self.power * min(10.0, (now - self._at) / 1e9) / 3600.0
        self._at = now
        return BatterySample(stamp_ns=now, voltage=voltage, current=current, used_wh=self._used_wh)


@dataclass(slots=True)
class LongText:
    """STATUSTEXT in several packets, of which the last is not full (MAVLink 2)."""

    _id: int = 0
    _begun: str = ""

    def whole(self, text: str, number: int) -> str | None:
        """The text that ends with this packet; None: more of it comes. `number`: 0 for a text of
        one packet. Of a text whose end was lost nothing is said."""
        if number == 0:
            return text
        begun = self._begun if number == self._id else ""
        self._id, self._begun = number, begun + text
        if len(text) == TEXT and len(self._begun) < MOST_TEXT:
            return None
        done, self._id, self._begun = self._begun, 0, ""
        return done


@dataclass(slots=True)
class BoardUpdates:
    """Which of the many messages that repeat a value of one sensor bring a new one, and when it was
    measured.

    ArduSub takes over what its depth sensor and its compass have measured ten times a second
    (`update_altitude`, `update_batt_compass`), sends the same value until the next time, and stamps
    it when it is sent: at 1 m/s as much as 0.1 m late. A new value was taken over between the last
    message with the old one and this one; it is the mean since the time before
    (`AP_Baro_MS56XX::update`, `AP_Compass_Backend::drain_accumulated_samples`), so half of a period
    older.
    """

    age_ns: Ns  # of a value that has just been taken over
    same_ns: Ns  # a value that stays for longer is passed on: it was measured again, or is frozen
    _value: Hashable = None
    _sent_ns: Ns = 0  # stamp of the newest message
    _used_ns: Ns = 0  # … of the newest that brought something

    def measured_at(self, value: Hashable, sent_ns: Ns) -> Ns | None:
        """[ns] Middle of the time over which the value was measured; None: nothing new.

        Args:
            sent_ns: stamp of the message, which rises.
        """
        before, previous_ns = self._value, self._sent_ns
        self._value, self._sent_ns = value, sent_ns
        if value == before and sent_ns - self._used_ns < self.same_ns:
            return None
        self._used_ns = sent_ns
        if before is None or value == before:
            return sent_ns - self.age_ns
        return sent_ns - self.age_ns - min(sent_ns - previous_ns, PERIOD_NS) // 2


def _vector(fields: dict[str, Any], part: str, unit: float) -> Vec3 | None:
    x, y, z = (unit * fields[f"{axis}{part}"] for axis in "xyz")
    return (x, y, z) if isfinite(x + y + z) and max(abs(x), abs(y), abs(z)) < 1e6 else None
