"""A vehicle as its TOML file describes it: one model, vehicle = a parameter file.

Six-vectors are in SNAME order X, Y, Z, K, M, N about the vehicle's origin, body frame FRD.
"""

from math import hypot
from typing import Annotated

import msgspec

from messages.units import FiniteSetting, NotNegativeSetting, Positive
from services.marine.calibration import SensorCalibration
from services.marine.mounting import Mounting
from services.marine.thrust_curve import CURVES, LINEAR
from services.marine.thruster_lag import Lag, LagMode, first_order, modes_of

SettingVec3 = tuple[FiniteSetting, FiniteSetting, FiniteSetting]
Diagonal = tuple[
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
]


class Thruster(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A propeller and its driver, which takes commands in newtons.

    Raises:
        ValueError: an unknown curve, limits or a dead-band that it cannot have, or a dead-band
            beyond a limit.
    """

    name: str
    position: SettingVec3  # [m] FRD, of the propeller
    direction: SettingVec3  # [-] FRD, of the force for a positive command; need not be normalised
    max_thrust: Positive  # [N] of a positive command
    max_reverse: Positive | None = None  # [N] of a negative command; None: the same
    dead_band: NotNegativeSetting = 0.0  # [N] commands smaller than this produce nothing
    time_constant: Positive = 0.08  # [s] first-order lag of the thrust …
    lag: Lag | None = None  # … unless a transfer function is given
    curve: str = LINEAR  # thrust over voltage, see thrust_curve.py

    def __post_init__(self) -> None:
        reverse, forward = self.limits
        if self.dead_band >= min(-reverse, forward):
            raise ValueError(
                f"thruster {self.name}: dead_band must be less than its limits, found "
                f"{self.dead_band:g} N"
            )
        if self.curve not in (LINEAR, *CURVES):
            raise ValueError(
                f"thruster {self.name}: unknown curve {self.curve!r}; there are "
                f"{', '.join((LINEAR, *CURVES))}"
            )
        curve = CURVES.get(self.curve)
        if curve is not None and max(-reverse, forward) > curve.most:
            raise ValueError(
                f"thruster {self.name}: {self.curve} gives at most {curve.most:.2f} N, found "
                f"{max(-reverse, forward):g} N"
            )
        if curve is not None and self.dead_band < curve.dead_band:
            raise ValueError(
                f"thruster {self.name}: {self.curve} gives nothing below {curve.dead_band:.3f} N, "
                f"found a dead_band of {self.dead_band:g} N"
            )

    @property
    def limits(self) -> tuple[float, float]:
        """[N] Least (negative) and most thrust."""
        reverse = self.max_thrust if self.max_reverse is None else self.max_reverse
        return -reverse, self.max_thrust

    @property
    def modes(self) -> list[LagMode]:
        """How its thrust follows a command."""
        return first_order(self.time_constant) if self.lag is None else modes_of(self.lag)


class Vehicle(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Mass properties, hydrodynamics and thrusters (Fossen 2011, ch. 6 to 8; SI units).

    Raises:
        ValueError: two thrusters of the same name, a thruster far outside of the hull, or a hull
            that is far too large for its mass: most likely millimetres.
    """

    name: str
    mass: Positive  # [kg] in air
    net_buoyancy: FiniteSetting  # [N] buoyancy minus weight when submerged; + floats
    inertia: tuple[Positive, Positive, Positive]  # [kg m²] about roll, pitch, yaw, without water
    added_mass: Diagonal  # [kg, kg m²]
    linear_damping: Diagonal  # [N s/m, N m s/rad]
    quadratic_damping: Diagonal  # [N s²/m², N m s²/rad²]
    metacentric_height: NotNegativeSetting  # [m] centre of buoyancy above centre of gravity
    size: tuple[Positive, Positive, Positive]  # [m] length, width, height; origin in the middle
    thruster: Annotated[list[Thruster], msgspec.Meta(min_length=1)]
    mounting: Mounting = Mounting()  # of the sensors
    calibration: SensorCalibration = SensorCalibration()

    def __post_init__(self) -> None:
        names = [thruster.name for thruster in self.thruster]
        for number, name in enumerate(names, 1):
            if (first := names.index(name) + 1) < number:
                raise ValueError(
                    f"thruster number {first} and thruster number {number} are both called "
                    f"{name!r}, expected a name of its own for each"
                )
        length, width, height = self.size
        if self.mass < LIGHTEST * SEA_WATER * length * width * height:
            raise ValueError(
                f"a hull of {length:g} m × {width:g} m × {height:g} m (size) with a mass of "
                f"{self.mass:g} kg is lighter than any; sizes are in metres"
            )
        farthest = FARTHEST * hypot(length, width, height)
        for thruster in self.thruster:
            if (away := hypot(*thruster.position)) > farthest:
                raise ValueError(
                    f"thruster {thruster.name}: its position is {away:g} m from the middle of a "
                    f"hull of {length:g} m × {width:g} m × {height:g} m (size), allowed is "
                    f"{farthest:.3g} m; positions are in metres"
                )

    @property
    def vertical_thrust(self) -> tuple[float, float]:
        """[N] Most upwards and downwards, with every thruster that helps, when level."""
        up = down = 0.0
        for thruster in self.thruster:
            length = hypot(*thruster.direction)
            share = thruster.direction[2] / length if length > 0.0 else 0.0
            ends = [share * limit for limit in thruster.limits]
            up, down = up - min(ends), down + max(ends)
        return up, down

    @property
    def floating_depth(self) -> float:
        """[m] Depth of the origin when the vehicle floats at rest at the surface.

        The submerged share of the hull's height carries the weight.
        """
        weight = self.mass * GRAVITY
        share = min(1.0, weight / (weight + self.net_buoyancy))
        return self.size[2] * (share - 0.5)


GRAVITY = 9.81  # [m/s²]
SEA_WATER = 1025.0  # [kg/m³]
LIGHTEST = 1e-3  # [-] mass over that of as much water as the box around the hull has room for
FARTHEST = 2.0  # [-] of the box's diagonal: a thruster on an outrigger
ATMOSPHERE = 101_325.0  # [Pa] standard
