"""From the board's telemetry to sensor samples, in SI units and body axes."""

from math import isfinite
from typing import Any

from messages.sensors import BatterySample, ImuSample, MagnetometerSample, PressureSample
from messages.units import Ns, Vec3

G = 9.80665  # [m/s²] of a milli-g
TESLA_PER_GAUSS = 1e-4
IMU_MESSAGES = ("HIGHRES_IMU", "RAW_IMU")  # best first; the first is new in 4.8
PRESSURE_MESSAGE, BATTERY_MESSAGE = "SCALED_PRESSURE2", "SYS_STATUS"
ENCLOSURE_MESSAGE, ENCLOSURE_HZ = "SCALED_PRESSURE", 1.0  # the barometer inside
MESSAGES = (*IMU_MESSAGES, PRESSURE_MESSAGE, BATTERY_MESSAGE, ENCLOSURE_MESSAGE)


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


def field_of(fields: dict[str, Any]) -> tuple[float, ...]:
    """What an IMU message says of the compass, in its own unit."""
    return fields["xmag"], fields["ymag"], fields["zmag"]


def magnetometer(name: str, fields: dict[str, Any], stamp_ns: Ns) -> MagnetometerSample | None:
    gauss = 1.0 if name == "HIGHRES_IMU" else 1e-3
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


def _vector(fields: dict[str, Any], part: str, unit: float) -> Vec3 | None:
    x, y, z = (unit * fields[f"{axis}{part}"] for axis in "xyz")
    return (x, y, z) if isfinite(x + y + z) and max(abs(x), abs(y), abs(z)) < 1e6 else None
