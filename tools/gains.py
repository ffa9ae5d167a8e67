"""`lindy gains`: the control gains of an axis, from what an error is worth, and a check in the loop
as it runs.

Linear quadratic design. The plant is inertia and linear drag, sampled exactly, its thrusters taken
as prompt. The cost is the sum of q e² + q_v e'² + ρ (u - u_ref)², e the distance from the reference
and u_ref the force the reference needs. In the error the plant is then autonomous, so that 100 %
feed-forward is optimal for every ρ (the answer to Andrén 2023, 7.2.1).
"""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from cyclopts import Parameter
from msgspec.structs import replace
from numpy.typing import NDArray

from services.control.axis.axis import WIDEST, Gains
from services.control.axis.plant import Plant, lags_of, plant_of
from services.control.core import PERIOD_S
from services.control.stability import ROWS, SampledLoop, sampled_loop
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.choices import Overrides, VehicleName

Matrix = NDArray[np.float64]
SMALL = 1e-5  # [-] drag over a step beside inertia
DOUBLINGS = 60  # far more than any loop needs: the error is squared each time


class Worth(NamedTuple):
    """Errors that are as bad as each other, and as bad as this much force (Bryson's rule)."""

    position: float  # [m] or [rad]
    velocity: float  # [m/s] or [rad/s]
    force: float  # [N] or [N m]
    patience: float  # [s] for which an error of `position` may last


# As good as each other; of a way [m], and of a turn [rad].
USUAL_WAY, USUAL_TURN = Worth(0.05, 0.1, 5.0, 5.0), Worth(0.052, 0.175, 0.4, 5.0)


class LqGains(NamedTuple):
    kp: float  # [N/m] or [N m/rad]
    kd: float  # [N s/m] or [N m s/rad]
    ki: float  # [N/(m s)] or [N m/(rad s)]


def sampled(plant: Plant, dt: float) -> tuple[Matrix, Matrix]:
    """(2, 2) and (2, 1): position and velocity one step on, from themselves and a held force."""
    inertia = plant.sampled_inertia(dt)
    x = plant.linear * dt / plant.inertia
    far = dt * plant.inertia / inertia  # [m] one step at 1 m/s, left to itself
    series = dt * dt / 2 / plant.inertia * (1.0 - x / 3)  # where the exact one would cancel
    pushed = series if x < SMALL else (dt - far) / plant.linear
    kept = 1.0 - x * plant.inertia / inertia  # exp(-x)
    return np.array([[1.0, far], [0.0, kept]]), np.array([[pushed], [dt / inertia]])


def feedback(plant: Plant, worth: Worth, dt: float) -> LqGains:
    """Gains on error, its rate and its integral that minimise the cost."""
    two, push = sampled(plant, dt)
    A = np.eye(3)
    A[:2, :2], A[2, 0] = two, dt  # the third state is the integral of the position
    B = np.vstack([push, [[0.0]]])
    sizes = np.array([worth.position, worth.velocity, worth.position * worth.patience])
    gains = regulator(A, B, np.diag(1.0 / sizes**2), 1.0 / worth.force**2)
    return LqGains(*gains.tolist())


def regulator(A: Matrix, B: Matrix, Q: Matrix, rho: float) -> Matrix:
    """(n,) K of u = -K x that minimises Σ xᵀQx + ρ u² for x₊ = A x + B u.

    The discrete Riccati equation by structured doubling (Chu, Fan, Lin & Wang 2004, Int. J.
    Control 77): every pass doubles the number of steps that are looked ahead.

    Raises:
        ValueError: it does not settle.
    """
    move, reach, cost = A, B @ B.T / rho, Q
    for _ in range(DOUBLINGS):
        inner = np.linalg.inv(np.eye(len(A)) + reach @ cost)
        more = move.T @ cost @ inner @ move
        reach = reach + move @ inner @ reach @ move.T
        move = move @ inner @ move
        cost = cost + (more + more.T) / 2
        if np.abs(more).max() <= 1e-12 * np.abs(cost).max():
            return (B.T @ cost @ A / (rho + (B.T @ cost @ B).item()))[0]
    raise ValueError("these weights have no settled solution")


LoopName = Literal["depth", "heading", "surge", "sway"]
SPEED: dict[LoopName, float] = {"depth": 0.3, "heading": 0.5, "surge": 0.3, "sway": 0.3}
# [m/s, rad/s] at which drag is made linear
MARGINS = (1.0, 100.0)  # [-] between these the gain margin is looked for


class Design(NamedTuple):
    gains: Gains
    radius: float  # [-] largest eigenvalue of the sampled loop
    margin: float  # [-] kp and kd may be this many times larger before it is unstable


def design(vehicle: Vehicle, axis: LoopName, worth: Worth, observer: float = 0.0) -> Design:
    """
    Args:
        observer: [rad/s] of a disturbance observer; 0: none.

    Raises:
        LindyError: thrusters and sampling make the loop unstable with the best of gains.
    """
    row = ROWS[axis]
    real, lag = plant_of(vehicle, row), lags_of(vehicle)[row]
    plant = Plant(real.inertia, real.linear + 2 * real.quadratic * SPEED[axis])
    found = feedback(plant, worth, PERIOD_S)
    usual = Gains(
        kp=found.kp,
        kd=found.kd,
        ki=found.ki,
        max_error=6 * worth.position,
        max_integral=3 * worth.force,
        observer=observer,
    )
    loop = sampled_loop(vehicle, axis, PERIOD_S)
    radius = loop.radius(usual, usual)
    if radius > 1.0:
        raise LindyError(
            f"control.{axis}: the loop with kp = {found.kp:.3g} and kd = {found.kd:.3g} is not "
            f"stable behind thrusters with a lag of {lag:g} s (largest eigenvalue {radius:.4f}); "
            "let more error be worth as much force"
        )
    return Design(usual, radius, _margin(loop, usual))


def lines(axis: LoopName, found: Design, worth: Worth) -> list[str]:
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
        "acceleration_percent = 100.0  # [%]",
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


def gains(
    axis: LoopName,
    /,
    *,
    vehicle: VehicleName = "pioneer",
    error: Annotated[float | None, Parameter(help="[m] or [rad]")] = None,
    error_rate: Annotated[float | None, Parameter(help="[m/s] or [rad/s]")] = None,
    effort: Annotated[float | None, Parameter(help="[N] or [N m]")] = None,
    observer: Annotated[
        float,
        Parameter(help="[rad/s] of a disturbance observer, at most 50, checked with the rest"),
    ] = 0.0,
    set_: Overrides = (),
) -> int:
    """Find control gains for an axis of a vehicle (LQ).

    Printed for the vehicle's file. An error as large as --error, a rate as large as --error-rate
    and a force as large as --effort are equally bad. Left out, they are 5 cm, 10 cm/s and 5 N; of
    the heading 3 deg, 10 deg/s and 0.4 N m.

    Example: lindy gains depth --error 0.1 --effort 8 --observer 3
    """
    given = {"error": error, "error-rate": error_rate, "effort": effort}
    for name, value in given.items():
        if value is not None and not 0.0 < value < 1e6:
            raise LindyError(f"--{name} is {value:g}, expected more than 0 and less than 1e6")
    if not 0.0 <= observer <= WIDEST:
        raise LindyError(f"--observer is {observer:g}, expected 0 to {WIDEST:g} rad/s")
    usual = USUAL_TURN if axis == "heading" else USUAL_WAY
    worth = usual._replace(
        position=error or usual.position,
        velocity=error_rate or usual.velocity,
        force=effort or usual.force,
    )
    stack = Stack(vehicle=vehicle, overrides=list(set_))
    stack.check(known_tables(Registry.read()))
    try:
        with np.errstate(all="ignore"):
            found = design(stack.section("vehicle", Vehicle), axis, worth, observer)
    except ValueError as why:
        raise LindyError(f"--error, --error-rate and --effort: {why}; choose nearer ones") from None
    print("\n".join(lines(axis, found, worth)))
    return 0
