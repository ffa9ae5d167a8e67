"""A map: which field of which message of a log is which of ours, in which unit. A TOML file."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from math import pi
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import msgspec
import numpy as np

from messages.pilot import FlightMode
from services.marine.mounting import ALONG, Rotation
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file, nearest, read

FOLDER = "imports"
STAMP_UNITS = {"ns": 1, "us": 1000, "ms": 10**6, "s": 10**9, "ros": 1, "date": 1}  # [ns]
AXES: Mapping[str, Rotation] = {
    "FRD": ALONG,
    "FLU": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
}  # [-] to forward, starboard, down
WORLDS: Mapping[str, Rotation] = {
    "NED": ALONG,
    "ENU": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
}  # [-] to north, east, down
MODES: tuple[str, ...] = get_args(FlightMode)
ORTHONORMAL = 1e-3  # [-] greatest error of a rotation

Limits = tuple[float, float]  # least and most


class MappedQuantity(NamedTuple):
    """What a field of ours measures."""

    units: Mapping[str, float]  # that a map may name → SI; the first is SI
    possible: Limits  # [SI] the amount of a value: a sample outside is none
    # [SI] the median of a stream: where it is outside, the unit is wrong; None: as possible.
    usual: Limits | None = None

    @property
    def typical(self) -> Limits:
        return self.usual or self.possible


QUANTITIES: Mapping[str, MappedQuantity] = {
    # Gravity is in every IMU; of a gyroscope 2000 deg/s are full scale.
    "acceleration": MappedQuantity(
        {"m/s²": 1.0, "mm/s²": 1e-3, "g": GRAVITY, "mg": 1e-3 * GRAVITY}, (0.0, 320.0), (4.0, 25.0)
    ),
    "angular rate": MappedQuantity(
        {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180.0, "mdeg/s": 1e-3 * pi / 180.0},
        (0.0, 40.0), (0.0, 15.0),
    ),
    "magnetic field": MappedQuantity(
        {"T": 1.0, "mT": 1e-3, "µT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7},
        (1e-7, 2e-3), (2e-6, 1e-3),
    ),
    "pressure": MappedQuantity(  # usual: from a lake in the Andes to 6400 m
        {"Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1e3, "bar": 1e5}, (3e4, 1.2e8), (5e4, 6.5e7)
    ),
    "temperature": MappedQuantity({"°C": 1.0, "c°C": 0.01}, (-60.0, 150.0)),
    "velocity": MappedQuantity({"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3}, (0.0, 20.0)),
    "angle": MappedQuantity({"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0}, (-7.0, 7.0)),
    "quaternion": MappedQuantity({"1": 1.0}, (0.9, 1.1)),
    "depth": MappedQuantity({"m": 1.0, "cm": 0.01, "mm": 1e-3}, (-100.0, 12e3)),
    "depth rate": MappedQuantity({"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3}, (-20.0, 20.0)),
    "length": MappedQuantity({"m": 1.0, "cm": 0.01, "mm": 1e-3}, (0.0, 12e3)),
    "voltage": MappedQuantity({"V": 1.0, "mV": 1e-3}, (0.5, 1000.0)),
    "current": MappedQuantity({"A": 1.0, "cA": 0.01, "mA": 1e-3}, (-2000.0, 2000.0)),
    "energy": MappedQuantity({"Wh": 1.0, "hJ": 100.0 / 3600.0, "J": 1.0 / 3600.0}, (-1e6, 1e6)),
    "force": MappedQuantity({"N": 1.0, "kgf": GRAVITY}, (-1e5, 1e5)),
    "share": MappedQuantity({"1": 1.0, "%": 0.01, "‰": 1e-3}, (-1.1, 1.1)),
    "word": MappedQuantity({"1": 1.0}, (-1e18, 1e18)),
}  # fmt: skip


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


class FieldMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a field of ours comes from: (number in the log - zero) times unit, or, with `full`,
    over (full - zero)."""

    from_: list[str] = msgspec.field(name="from", default_factory=list[str])  # data.4, header.x
    value: float | None = None  # [unit] in place of `from`, where the log does not have it
    unit: str = "1"
    zero: float = 0.0  # in the log's own number
    full: float | None = None  # number in the log that means 1
    mask: int | None = None  # bits of a whole number; any of them set is 1
    values: dict[str, str | bool] = {}  # word or number in the log → ours
    curve: list[tuple[float, float]] = []  # number in the log, ours [unit]; linear in between


class TakenMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One of our messages from one of the log's."""

    as_: str = msgspec.field(name="as")  # key of ours
    topic: str = ""  # its topic or name in the log; * stands for any letters
    type: str = ""  # or the type of its messages
    only: dict[str, float | bool | str] = {}  # field → value; other rows are left out
    stamp: str = ""  # field with the time at which it was measured; empty: it has none
    # ros: seconds and nanoseconds; date: as 2024-05-01T09:30:00.123, in tables
    stamp_unit: Literal["ns", "us", "ms", "s", "ros", "date"] = "ros"
    # Whose clock the stamp is by. board: a clock of its own, which is put on the logger's; logger:
    # that of the log; arrival: there is no stamp, or it is not to be used.
    clock: Literal["board", "logger", "arrival"] = "arrival"
    axes: str | Rotation = "FRD"  # of its vectors: FRD, FLU or the rotation to FRD
    world: Literal["NED", "ENU"] = "NED"  # in which a quaternion turns the body's axes
    repeats_s: float = 0.0  # [s] the same values again within this time are no new measurement
    fields: dict[str, FieldMap]

    @property
    def where(self) -> str:
        """As sentences name it."""
        return f"{self.topic or self.type} as {self.as_}"

    @property
    def names(self) -> set[str]:
        """Fields of the log that it names."""
        named = {name for field in self.fields.values() for name in field.from_}
        return named | {*self.only} | ({self.stamp} if self.stamp else set())

    @property
    def rotation(self) -> Rotation:
        return AXES[self.axes] if isinstance(self.axes, str) else self.axes


class ImportMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A whole map file."""

    about: str
    vehicle: str  # that the recording is of, unless --vehicle says another
    began: datetime | None = None  # UTC of the first row, for a log whose clock does not know it
    take: list[TakenMessage]  # of two that give the same field, the first that the log has


def read_map(name: str) -> tuple[ImportMap, Path]:
    """
    Args:
        name: in deploy/imports, or the path of a TOML file.

    Raises:
        LindyError: there is no such map, or it is wrong; says where and what is allowed.
    """
    path = deploy_file(FOLDER, name)
    found = read(path, ImportMap)
    for number, taken in enumerate(found.take, 1):
        try:
            _check(taken)
        except ValueError as error:
            raise LindyError(f"{path}: take number {number} ({taken.where}): {error}") from None
    if found.began is not None and found.began.tzinfo is None:
        raise LindyError(f"{path}: began: add the time zone, as in 2024-05-01T09:30:00Z")
    return found, path


def remedy(setting: str, fitting: Iterable[str], otherwise: str) -> str:
    """What to write in a map: `unit = "g" or unit = "mg"`."""
    return " or ".join(f'{setting} = "{each}"' for each in fitting) or otherwise


def _check(taken: TakenMessage) -> None:
    """
    Raises:
        ValueError: what is wrong with it.
    """
    if taken.as_ not in TARGETS:
        raise ValueError(f"as: unknown key {taken.as_!r}{nearest(taken.as_, list(TARGETS))}")
    if not taken.topic and not taken.type:
        raise ValueError("write topic or type, by which it is found in the log")
    if taken.clock != "arrival" and not taken.stamp:
        raise ValueError(f'clock is "{taken.clock}", but no field is named by stamp')
    _check_axes(taken.axes)
    known = TARGETS[taken.as_]
    for name, field in taken.fields.items():
        if name not in known:
            raise ValueError(f"unknown field {name!r}{nearest(name, list(known))}")
        size = known[name].size
        if field.value is None and (not field.from_ or size not in (0, len(field.from_))):
            wanted = "some" if size == 0 else str(size)
            raise ValueError(f"{name}: from has {len(field.from_)} names, expected {wanted}")
        _check_unit(name, field, known[name].quantity)
        if name == "mode" and (odd := {*field.values.values()} - {*MODES}):
            raise ValueError(f"mode: values: {odd.pop()!r} is none of {', '.join(MODES)}")
    missing = [n for n, field in known.items() if field.required and n not in taken.fields]
    if missing:
        raise ValueError(f"the field {missing[0]} is missing")


def _check_unit(name: str, field: FieldMap, quantity: str) -> None:
    units = QUANTITIES[quantity].units
    if field.unit not in units and field.full is None:
        raise ValueError(
            f"{name}: unit is {field.unit!r}, expected one of {quantity}: {', '.join(units)}"
        )
    if field.full is not None and field.full == field.zero:
        raise ValueError(f"{name}: full and zero are both {field.zero:g}")
    if field.curve and (
        len(field.curve) < 2 or [*field.curve] != sorted(field.curve, key=lambda at: at[0])
    ):
        raise ValueError(f"{name}: curve: expected two points or more, the first numbers rising")


def _check_axes(axes: Any) -> None:
    if isinstance(axes, str):
        if axes not in AXES:
            raise ValueError(f'axes is "{axes}", expected {" or ".join(AXES)} or a rotation')
        return
    R = np.array(axes)
    if not np.allclose(R @ R.T, np.eye(3), atol=ORTHONORMAL):
        raise ValueError("axes: the rows are not of length 1 and at right angles to each other")
    if np.linalg.det(R) < 0.0:
        raise ValueError(
            "axes: left-handed (determinant -1): it mirrors; change the sign of one whole row, "
            "so that it turns to forward, starboard, down"
        )
