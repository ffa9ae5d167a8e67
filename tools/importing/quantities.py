"""Units that a map may name, which field of ours has which quantity, and what a value can be."""

from collections.abc import Mapping, Sequence
from math import pi
from typing import NamedTuple

from services.marine.vehicle import GRAVITY

UNITS: Mapping[str, Mapping[str, float]] = {  # quantity → unit → SI
    "acceleration": {"m/s²": 1.0, "mm/s²": 1e-3, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "angular rate": {
        "rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180.0, "mdeg/s": 1e-3 * pi / 180.0,
    },
    "magnetic field": {"T": 1.0, "mT": 1e-3, "µT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7},
    "pressure": {"Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1e3, "bar": 1e5},
    "temperature": {"°C": 1.0, "c°C": 0.01},
    "velocity": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0},
    "quaternion": {"1": 1.0},
    "depth": {"m": 1.0, "cm": 0.01, "mm": 1e-3},
    "depth rate": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3},
    "length": {"m": 1.0, "cm": 0.01, "mm": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "cA": 0.01, "mA": 1e-3},
    "energy": {"Wh": 1.0, "hJ": 100.0 / 3600.0, "J": 1.0 / 3600.0},
    "force": {"N": 1.0, "kgf": GRAVITY},
    "share": {"1": 1.0, "%": 0.01, "‰": 1e-3},
    "word": {"1": 1.0},
}  # fmt: skip
# [SI] Least and most of the amount of a value: a sample outside is none. Where more than half are,
# the unit is wrong. Of a gyroscope 2000 deg/s are full scale.
POSSIBLE: Mapping[str, tuple[float, float]] = {
    "acceleration": (0.0, 320.0),
    "angular rate": (0.0, 40.0),
    "magnetic field": (1e-7, 2e-3),
    "pressure": (3e4, 1.2e8),
    "temperature": (-60.0, 150.0),
    "velocity": (0.0, 20.0),
    "angle": (-7.0, 7.0),
    "quaternion": (0.9, 1.1),
    "depth": (-100.0, 12e3),
    "depth rate": (-20.0, 20.0),
    "length": (0.0, 12e3),
    "voltage": (0.5, 1000.0),
    "current": (-2000.0, 2000.0),
    "energy": (-1e6, 1e6),
    "force": (-1e5, 1e5),
    "share": (-1.1, 1.1),
    "word": (-1e18, 1e18),
}
# [SI] Least and most of the median of a stream: gravity is in every IMU.
TYPICAL: Mapping[str, tuple[float, float]] = {
    **POSSIBLE,
    "acceleration": (4.0, 25.0),
    "angular rate": (0.0, 15.0),
    "magnetic field": (2e-6, 1e-3),
    "pressure": (5e4, 6.5e7),  # from a lake in the Andes to 6400 m
}


class TakenField(NamedTuple):
    """A field of one of our messages that a map can fill."""

    quantity: str
    size: int = 1  # numbers; 0: any
    required: bool = True


VECTOR, OPTIONAL = 3, False
TARGETS: Mapping[str, Mapping[str, TakenField]] = {  # key → field
    "sensor/imu": {
        "specific_force": TakenField("acceleration", VECTOR),
        "angular_rate": TakenField("angular rate", VECTOR),
    },
    "sensor/magnetometer": {"field": TakenField("magnetic field", VECTOR)},
    "sensor/pressure": {
        "pressure": TakenField("pressure"),
        "temperature": TakenField("temperature", 1, OPTIONAL),
    },
    "sensor/dvl": {
        "velocity": TakenField("velocity", VECTOR),
        "std": TakenField("velocity"),
        "altitude": TakenField("length", 1, OPTIONAL),
    },
    "sensor/battery": {
        "voltage": TakenField("voltage"),
        "current": TakenField("current"),
        "used_wh": TakenField("energy", 1, OPTIONAL),
    },
    "sensor/temperature": {"temperature": TakenField("temperature")},
    "pilot/command": {
        "surge": TakenField("share"),
        "sway": TakenField("share"),
        "heave": TakenField("share"),
        "yaw": TakenField("share"),
        "tilt": TakenField("share", 1, OPTIONAL),
    },
    "vehicle/status": {
        "armed": TakenField("word", 1, OPTIONAL),
        "mode": TakenField("word", 1, OPTIONAL),
    },
    "vehicle/estimate": {
        "roll": TakenField("angle", 1, OPTIONAL),
        "pitch": TakenField("angle", 1, OPTIONAL),
        "heading": TakenField("angle", 1, OPTIONAL),
        "attitude": TakenField("quaternion", 4, OPTIONAL),  # becomes roll, pitch and heading
        "depth": TakenField("depth", 1, OPTIONAL),
        "depth_rate": TakenField("depth rate", 1, OPTIONAL),
        "angular_rate": TakenField("angular rate", VECTOR, OPTIONAL),
    },
    "control/thrusters": {
        "thrust": TakenField("force", 0),
        "armed": TakenField("word", 1, OPTIONAL),  # else as the status says
    },
    "vehicle/actuation": {"thrust": TakenField("force", 0)},
}


def amount(values: Sequence[float]) -> float:
    """[SI] What is compared with the limits: the length of a vector, else the value."""
    return values[0] if len(values) == 1 else sum(v * v for v in values) ** 0.5


def is_possible(values: Sequence[float], quantity: str) -> bool:
    """Can it be? A vector by its length; each of several forces by itself."""
    least, most = POSSIBLE[quantity]
    if quantity == "force":
        return all(least <= value <= most for value in values)
    return least <= amount(values) <= most


def better_units(median: float, unit: str, quantity: str) -> list[str]:
    """Units in which the median [SI, by `unit`] of a stream would be possible."""
    least, most = TYPICAL[quantity]
    units = UNITS[quantity]
    raw = median / units[unit]
    return [name for name, factor in units.items() if least <= raw * factor <= most]
