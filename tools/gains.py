"""`lindy gains`: the control gains of an axis, from what an error is worth."""

from typing import Annotated, Literal, NamedTuple

from cyclopts import Parameter
from msgspec.structs import replace

from services.control.axis_law import Gains
from services.control.core import PERIOD_S
from services.control.plant import Plant, plant_of
from services.control.produced import lags_of
from services.control.sampled_loop import SampledLoop
from services.control.stability import ROWS
from services.marine.vehicle import Vehicle
from services.reference.minimum_jerk import Limits
from services.runtime.errors import LindyError
from services.runtime.stack import Stack
from tools.lq import Manoeuvre, Worth, best_acceleration, feedback

AxisName = Literal["depth", "heading", "surge", "sway"]
MARGINS = (1.0, 100.0)  # [-] between these the gain margin is looked for


class Design(NamedTuple):
    gains: Gains
    radius: float  # [-] largest eigenvalue of the sampled loop
    margin: float  # [-] kp and kd may be this many times larger before it is unstable
    percent: float  # [%] best acceleration feed-forward if the whole force is weighed


def gains(
    axis: AxisName,
    /,
    *,
    vehicle: str = "pioneer",
    error: float | None = None,
    rate: float | None = None,
    force: float | None = None,
    patience: float = 5.0,
    observer: float = 0.0,
    speed: float | None = None,
    jerk: float | None = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", negative=())] = (),
) -> int:
    """Find control gains for an axis of a vehicle (LQ), and print them for its file.

    Example: lindy gains depth --error 0.1 --force 8 --observer 3

    An error as large as --error, a rate as large as --rate and a force as large as --force are
    equally bad. Left out, they are 5 cm, 10 cm/s and 5 N; of the heading 3 deg, 10 deg/s and
    0.4 N m.

    Parameters
    ----------
    axis
        depth, heading, surge or sway
    vehicle
        a name in deploy/vehicles, or the path of a TOML file
    error
        [m] or [rad]
    rate
        [m/s] or [rad/s]
    force
        [N] or [N m]
    patience
        [s] for which such an error may last; smaller makes ki larger
    observer
        [rad/s] of a disturbance observer, checked with the rest
    speed
        [m/s] or [rad/s] at which drag is made linear, and of the trial manoeuvre
    jerk
        [m/s³] or [rad/s³] of the trial manoeuvre
    set_
        key.path=value into the vehicle file; repeatable
    """
    turns = axis == "heading"
    usual = (0.052, 0.175, 0.4, 0.5, 4.0) if turns else (0.05, 0.1, 5.0, 0.3, 1.5)
    asked = (error, rate, force, speed, jerk)
    numbers = [
        given if given is not None else default for given, default in zip(asked, usual, strict=True)
    ]
    for name, value in zip(("error", "rate", "force", "speed", "jerk"), numbers, strict=True):
        _positive(name, value)
    _positive("patience", patience)
    position, velocity, effort, fast, sharp = numbers
    stack = Stack(vehicle=vehicle, overrides=list(set_))
    worth = Worth(position, velocity, effort, patience)
    design_ = design(stack.section("vehicle", Vehicle), axis, worth, observer, fast, sharp)
    print("\n".join(lines(axis, design_, worth)))
    return 0


def design(
    vehicle: Vehicle, axis: AxisName, worth: Worth, observer: float, speed: float, jerk: float
) -> Design:
    """
    Raises:
        LindyError: thrusters and sampling make the loop unstable with the best of gains.
    """
    row = ROWS[axis]
    real, lag = plant_of(vehicle, row), lags_of(vehicle)[row]
    plant = Plant(real.inertia, real.linear + 2 * real.quadratic * speed)
    found = feedback(plant, worth, PERIOD_S)
    usual = Gains(
        kp=found.kp,
        kd=found.kd,
        ki=found.ki,
        max_error=6 * worth.position,
        max_integral=3 * worth.force,
        observer=observer,
    )
    loop = SampledLoop(real, lag, PERIOD_S)
    radius = loop.radius(usual, usual)
    if radius > 1.0:
        raise LindyError(
            f"control.{axis}: the loop with kp = {found.kp:.3g} and kd = {found.kd:.3g} is not "
            f"stable behind thrusters with a lag of {lag:g} s (largest eigenvalue {radius:.4f}); "
            "let more error be worth as much force"
        )
    weight = (worth.position / worth.force) ** 2
    manoeuvre = Manoeuvre(speed, Limits(jerk))
    percent = best_acceleration(
        plant, found.kp, found.kd, weight, manoeuvre, PERIOD_S, held=PERIOD_S
    )
    return Design(usual, radius, _margin(loop, usual), percent)


def lines(axis: AxisName, found: Design, worth: Worth) -> list[str]:
    """What to put into the vehicle file."""
    unit, push = ("rad", "N m") if axis == "heading" else ("m", "N")
    g = found.gains
    learnt = [f"observer = {g.observer:g}  # [rad/s]"] if g.observer else []
    return [
        f"# LQ: {worth.position:g} {unit}, {worth.velocity:g} {unit}/s and {worth.force:g} {push} "
        f"are equally bad, an error may last {worth.patience:g} s.",
        f"# Sampled at {1 / PERIOD_S:g} Hz behind its thrusters: largest eigenvalue "
        f"{found.radius:.4f}, gain margin {found.margin:.1f}.",
        f"[control.{axis}]",
        f"kp = {g.kp:.3g}  # [{push}/{unit}]",
        f"kd = {g.kd:.3g}  # [{push} s/{unit}]",
        f"ki = {g.ki:.3g}  # [{push}/({unit} s)]",
        *learnt,
        f"max_error = {g.max_error:.3g}  # [{unit}]",
        f"max_integral = {g.max_integral:.3g}  # [{push}]",
        f"acceleration_percent = 100.0  # [%] or {found.percent:.1f} if the whole force is weighed",
    ]


def _margin(loop: SampledLoop, usual: Gains) -> float:
    """[-] By bisection; the largest looked for where there is none below it."""

    def stable(times: float) -> bool:
        more = replace(usual, kp=times * usual.kp, kd=times * usual.kd)
        return loop.radius(more, more) <= 1.0

    low, high = MARGINS
    if stable(high):
        return high
    while high - low > 1e-3 * low:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _positive(name: str, value: float) -> None:
    if not 0.0 < value < 1e6:
        raise LindyError(f"--{name} is {value:g}, expected more than 0 and less than 1e6")
