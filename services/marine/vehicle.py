"""A vehicle as its TOML file describes it: one model, vehicle = a parameter file.

Six-vectors are in SNAME order X, Y, Z, K, M, N about the vehicle's origin, body frame FRD.

A thruster's lag is a sum of decaying modes, exact for any time step. G(s) = b(s)/a(s) with G(0) = 1
and distinct poles p has the step response f(t) = 1 − Σ c exp(p t), with c = −b(p) / (p a'(p))
(partial fractions, Heaviside). So a thruster's state is its final value and the remaining gap of
each mode.

Thrust of a propeller as a function of voltage, and the inverse, for its driver.

Commands are in newtons, and the driver inverts the curve. Two properties remain: the largest
thrust, and the dead-band in the middle where the motor does not turn.
"""

from cmath import exp as complex_exp
from collections.abc import Callable, Sequence
from math import exp, hypot, sqrt
from typing import Annotated, NamedTuple, overload

import msgspec

from messages.units import FiniteSetting, NotNegativeSetting, Positive, Vec6
from services.marine.mounting import Mounting, SensorCalibration
from services.marine.outputs import OUTPUTS, Output, checked

HALVINGS = 60  # of the interval 0 … 1: more than a float has digits


class ThrustCurve(NamedTuple):
    """Odd in the voltage, and rising up to `top`."""

    thrust: Callable[[float], float]  # [N] for a share of the voltage, -1 … 1
    top: float  # [-] share of the voltage beyond which thrust no longer grows
    silent: float  # [-] any smaller share does not turn the motor

    def share(self, newtons: float) -> float:
        """[-] Share of the voltage for this thrust, limited to `top`.

        By bisection: the polynomial has no inverse in closed form.
        """
        low, high = 0.0, self.top
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.thrust(middle) < abs(newtons) else (low, middle)
        return high if newtons >= 0 else -high

    @property
    def most(self) -> float:
        """[N]"""
        return self.thrust(self.top)

    @property
    def dead_band(self) -> float:
        """[N] Thrust at the edge of the dead-band."""
        return self.thrust(self.silent)


def t200(share: float) -> float:
    """[N] A Blue Robotics T200 at 16 V, identified by von Benzon et al. 2022 (doi
    10.3390/jmse10121898): -140.3 V⁹ + 389.9 V⁷ - 404.1 V⁵ + 176 V³ + 8.9 V."""
    square = share * share
    return share * (8.9 + square * (176.0 + square * (-404.1 + square * (389.9 - 140.3 * square))))


def ardusub_simulator(share: float) -> float:
    """[N] A motor of the simulator that comes with ArduSub's firmware: quadratic."""
    return 51.48 * share * abs(share)


def ardusub_simulator_plane(share: float) -> float:
    """[N] The same along its axis, where that is diagonal: as much forward as to the side."""
    return 2.0**0.5 * ardusub_simulator(share)


# The polynomial has its maximum at 97.2 %; the decrease beyond, 0.2 N, is an artefact of the fit.
# The ESC does not turn for pulses of 1464 to 1532 µs of 1100 to 1900 (a public fit), and that of
# ArduSub's simulator for 1475 to 1525.
CURVES: dict[str, ThrustCurve] = {
    "t200": ThrustCurve(t200, top=0.9716, silent=0.085),
    "ardusub_simulator": ThrustCurve(ardusub_simulator, top=1.0, silent=0.0625),
    "ardusub_simulator_plane": ThrustCurve(ardusub_simulator_plane, top=1.0, silent=0.0625),
}
LINEAR = "linear"  # no curve: limits and dead-band are those of the vehicle file

SettingVec3 = tuple[FiniteSetting, FiniteSetting, FiniteSetting]
Diagonal = tuple[
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
    NotNegativeSetting,
]
ComplexVec6 = tuple[complex, complex, complex, complex, complex, complex]
LagSetting = Annotated[float, msgspec.Meta(gt=0.0, le=5.0)]  # [s]
Coefficient = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
SAME_POLE = 1e-6  # [-] poles closer than this share of their size count as one
GRAVITY = 9.81  # [m/s²]
SEA_WATER = 1025.0  # [kg/m³]
LIGHTEST = 1e-3  # [-] mass over that of as much water as the box around the hull has room for
GYRATION = (0.02, 1.0)  # [-] least and most radius of gyration over the box's diagonal
FARTHEST = 2.0  # [-] of the box's diagonal: a thruster on an outrigger
SHORTEST = 1e-6  # of a direction
LONGEST_NAME = 40  # letters of a thruster's name, which stands in messages and on screens
ATMOSPHERE = 101_325.0  # [Pa] standard


class LagMode(NamedTuple):
    """A real pole, or one of a conjugate pair that stands for both: its thrust is the real part."""

    pole: complex  # [1/s]
    share: complex  # [-] c: this mode's initial gap, as a share of the step


class Lag(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """From command to thrust: b(s)/a(s), highest power of s first.

    Raises:
        ValueError: it does not settle at the command, does not follow smoothly, is not stable, or
            has a double pole.
    """

    numerator: Annotated[list[Coefficient], msgspec.Meta(min_length=1, max_length=8)]
    denominator: Annotated[list[Coefficient], msgspec.Meta(min_length=2, max_length=8)]

    def __post_init__(self) -> None:
        b, a = self.numerator, self.denominator
        if a[0] == 0 or len(b) >= len(a):
            raise ValueError(
                "lag: the denominator must begin with a number that is not 0 and be longer than "
                "the numerator, for thrust does not jump"
            )
        if a[-1] == 0 or abs(b[-1] / a[-1] - 1.0) > 1e-9:
            raise ValueError(
                f"lag: thrust must settle at the command, so the last coefficients must be equal "
                f"and not 0, found {b[-1]:g} and {a[-1]:g}"
            )
        import numpy as np  # half of the time a service takes to be imported: few have a lag

        poles = np.roots(a)
        if not all(pole.real < 0 for pole in poles):
            raise ValueError("lag: not stable, a pole does not lie left of the imaginary axis")
        apart = [abs(p - q) / abs(p) for i, p in enumerate(poles) for q in poles[:i]]
        if min(apart, default=1.0) < SAME_POLE:
            raise ValueError("lag: two poles are the same; make one a little faster")


def first_order(time_constant: float) -> list[LagMode]:
    """1/(τ s + 1): one mode."""
    return [LagMode(-1.0 / time_constant, 1.0)]


def modes_of(lag: Lag) -> list[LagMode]:
    """Partial fractions; one of each conjugate pair, with twice its share."""
    import numpy as np

    a, b = np.poly1d(lag.denominator), np.poly1d(lag.numerator)
    slope = a.deriv()
    modes = list[LagMode]()
    for p in np.roots(a):
        share = -complex(b(p) / (p * slope(p)))
        if abs(p.imag) <= SAME_POLE * abs(p):
            modes.append(LagMode(float(p.real), share.real))
        elif p.imag > 0:
            modes.append(LagMode(complex(p), 2 * share))
    return modes


def decay(pole: complex, seconds: float) -> complex:
    """[-] Remaining share of a mode; real for a real pole."""
    return exp(pole * seconds) if isinstance(pole, float) else complex_exp(pole * seconds)


class Thruster(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A propeller and its driver, which takes commands in newtons.

    Raises:
        ValueError: an unknown curve, limits or a dead-band that it cannot have, a dead-band beyond
            a limit, or a direction without length.
    """

    name: str
    position: SettingVec3  # [m] FRD, of the propeller
    direction: SettingVec3  # [-] FRD, of the force for a positive command; need not be normalised
    max_thrust: Positive  # [N] of a positive command
    max_reverse: Positive | None = None  # [N] of a negative command; None: the same
    dead_band: NotNegativeSetting = 0.0  # [N] commands smaller than this produce nothing
    time_constant: LagSetting = 0.08  # [s] first-order lag of the thrust …
    lag: Lag | None = None  # … unless a transfer function is given
    curve: str = LINEAR  # thrust over voltage, see CURVES

    def __post_init__(self) -> None:
        if not self.name.isprintable() or len(self.name) > LONGEST_NAME:
            raise ValueError(
                f"thruster {self.name[:LONGEST_NAME]!r}: expected a name of at most {LONGEST_NAME} "
                "printable letters"
            )
        if hypot(*self.direction) < SHORTEST:
            raise ValueError(f"thruster {self.name}: direction must not be (0, 0, 0)")
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
        ValueError: two thrusters of the same name, a thruster far outside of the hull, a hull that
            is far too large for its mass: most likely millimetres; an inertia that no hull of that
            mass and size has; or outputs that cannot be.
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
    output: tuple[Output, ...] = OUTPUTS  # lights, lasers, a gripper

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
        diagonal = hypot(length, width, height)
        least, most = (self.mass * (share * diagonal) ** 2 for share in GYRATION)
        for axis, inertia in zip(("roll", "pitch", "yaw"), self.inertia, strict=True):
            if not least <= inertia <= most:
                raise ValueError(
                    f"a mass of {self.mass:g} kg and an inertia of {inertia:g} kg m² about {axis} "
                    f"do not belong to one hull of {length:g} m × {width:g} m × {height:g} m "
                    f"(size), expected {least:.3g} to {most:.3g} kg m² of that mass"
                )
        farthest = FARTHEST * diagonal
        for thruster in self.thruster:
            if (away := hypot(*thruster.position)) > farthest:
                raise ValueError(
                    f"thruster {thruster.name}: its position is {away:g} m from the middle of a "
                    f"hull of {length:g} m × {width:g} m × {height:g} m (size), allowed is "
                    f"{farthest:.3g} m; positions are in metres"
                )
        checked(self.output, len(self.thruster))

    @property
    def vertical_thrust(self) -> tuple[float, float]:
        """[N] Most upwards and downwards, with every thruster that helps, when level."""
        up = down = 0.0
        for thruster in self.thruster:
            share = thruster.direction[2] / hypot(*thruster.direction)
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


def wrench_per_newton(thruster: Thruster) -> Vec6:
    """The thruster's column of the configuration matrix T: force and moment about the origin of
    one newton, [-, m] (Fossen 2011, eq. 12.226: f, r × f)."""
    dx, dy, dz = thruster.direction
    length = sqrt(dx * dx + dy * dy + dz * dz)
    x, y, z = thruster.position
    dx, dy, dz = dx / length, dy / length, dz / length
    return dx, dy, dz, y * dz - z * dy, z * dx - x * dz, x * dy - y * dx


def limited(thruster: Thruster, command: float) -> float:
    """[N] The nearest thrust within the thruster's limits."""
    reverse, forward = thruster.limits
    if command > forward:
        return forward
    return command if command >= reverse else reverse


def driven(thruster: Thruster, command: float) -> float:
    """[N] Thrust the thruster settles at: nothing inside the dead-band, the whole command just
    outside of it (the aggressive start described in Andrén 2023, §6.2.2).

    The driver inverts the thrust curve, so only its limits and dead-band remain.
    """
    return limited(thruster, command) if abs(command) >= thruster.dead_band else 0.0


@overload
def total_wrench(columns: Sequence[Vec6], thrust: Sequence[float]) -> Vec6: ...
@overload
def total_wrench(columns: Sequence[Vec6], thrust: Sequence[complex]) -> ComplexVec6: ...
def total_wrench(columns: Sequence[Vec6], thrust: Sequence[complex]) -> ComplexVec6:
    """τ = T f [N, N m] about the origin (Fossen 2011, §12.3)."""
    surge: complex = 0.0
    sway: complex = 0.0
    heave: complex = 0.0
    roll: complex = 0.0
    pitch: complex = 0.0
    yaw: complex = 0.0
    for (a, b, c, d, e, f), newtons in zip(columns, thrust, strict=True):
        surge += a * newtons
        sway += b * newtons
        heave += c * newtons
        roll += d * newtons
        pitch += e * newtons
        yaw += f * newtons
    return surge, sway, heave, roll, pitch, yaw
