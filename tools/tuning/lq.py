"""Linear quadratic design of one axis: the best gains for what an error is worth, how much
feed-forward is best, and a check in the loop as it runs.

The plant is inertia and linear drag, sampled exactly, its thrusters taken as prompt. The cost is
the sum of q e² + q_v e'² + ρ (u - u_ref)², e the distance from the reference and u_ref the force
the reference needs. In the error the plant is then autonomous, so that 100 % feed-forward is
optimal for every ρ (the answer to Andrén 2023, 7.2.1). Who weighs the whole force, ρ u², finds
less: see `best_acceleration`.
"""

from typing import Literal, NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from messages.reference import Motion
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import Plant, lags_of, plant_of
from services.control.core import PERIOD_S
from services.control.stability import ROWS, SampledLoop, sampled_loop
from services.marine.vehicle import Vehicle
from services.reference.trajectory.minimum_jerk import Limits, Ramp
from services.runtime.config.errors import LindyError

Matrix = NDArray[np.float64]
SMALL = 1e-5  # [-] drag over a step beside inertia
DOUBLINGS = 60  # far more than any loop needs: the error is squared each time


class Worth(NamedTuple):
    """Errors that are as bad as each other, and as bad as this much force (Bryson's rule)."""

    position: float  # [m] or [rad]
    velocity: float  # [m/s] or [rad/s]
    force: float  # [N] or [N m]
    patience: float  # [s] for which an error of `position` may last


class LqGains(NamedTuple):
    kp: float  # [N/m] or [N m/rad]
    kd: float  # [N s/m] or [N m s/rad]
    ki: float  # [N/(m s)] or [N m/(rad s)]


class StepManoeuvre(NamedTuple):
    """A step of the stick and back, as in Andrén 2023, 6.1.1."""

    speed: float  # [m/s] or [rad/s]
    limits: Limits
    seconds: float = 3.0  # [s] at speed; as long again and one more to come to rest


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


def best_acceleration(
    plant: Plant,
    kp: float,
    kd: float,
    weight: float,
    manoeuvre: StepManoeuvre,
    dt: float,
    *,
    held: float,
) -> float:
    """[%] Of the acceleration feed-forward that minimises Σ e² + weight Σ u² over a manoeuvre.

    Error and force are affine in the share, so the cost is a parabola and three flights find it.

    Args:
        weight: ρ/q [m²/N²] on the whole force; inf weighs the force alone.
        dt: [s] for which a force is held.
        held: [s] for which the feed-forward reckons it is held: dt is exact, 0 as in the thesis.
    """
    motions = list(_motions(manoeuvre, dt))
    flights = [_flown(plant, kp, kd, percent, motions, dt, held) for percent in (0.0, 100.0, 200.0)]
    costs = [u if weight == np.inf else e + weight * u for e, u in flights]
    slope, bend = costs[2] - costs[0], costs[0] - 2 * costs[1] + costs[2]
    return 100.0 - 50.0 * slope / bend


def _motions(manoeuvre: StepManoeuvre, dt: float) -> list[Motion]:
    ramp, motions = Ramp(manoeuvre.limits), list[Motion]()
    there, end = manoeuvre.seconds, 2 * manoeuvre.seconds + 1.0
    for k in range(round(end / dt)):
        ramp.aim(manoeuvre.speed if k * dt < there else 0.0, k * dt)
        motions.append(Motion(*ramp.at(k * dt)))
    return motions


def _flown(
    plant: Plant,
    kp: float,
    kd: float,
    percent: float,
    motions: list[Motion],
    dt: float,
    held: float,
) -> tuple[float, float]:
    """Σ e² and Σ u²."""
    gains = Gains(
        kp=kp, kd=kd, ki=0.0, max_error=1e6, max_integral=1e6, acceleration_percent=percent
    )
    law, (A, B) = Axis(gains, plant, period=held), sampled(plant, dt)
    (_, far), (_, kept) = A.tolist()
    (pushed,), (gained,) = B.tolist()
    x = v = errors = forces = 0.0
    for motion in motions:
        u = law.step(motion, x, v, dt)
        errors, forces = errors + (motion.position - x) ** 2, forces + u * u
        x, v = x + far * v + pushed * u, kept * v + gained * u
    return errors, forces


LoopName = Literal["depth", "heading", "surge", "sway"]
MARGINS = (1.0, 100.0)  # [-] between these the gain margin is looked for


class Design(NamedTuple):
    gains: Gains
    radius: float  # [-] largest eigenvalue of the sampled loop
    margin: float  # [-] kp and kd may be this many times larger before it is unstable
    percent: float  # [%] best acceleration feed-forward if the whole force is weighed


def design(
    vehicle: Vehicle, axis: LoopName, worth: Worth, observer: float, speed: float, jerk: float
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
    loop = sampled_loop(vehicle, axis, PERIOD_S)
    radius = loop.radius(usual, usual)
    if radius > 1.0:
        raise LindyError(
            f"control.{axis}: the loop with kp = {found.kp:.3g} and kd = {found.kd:.3g} is not "
            f"stable behind thrusters with a lag of {lag:g} s (largest eigenvalue {radius:.4f}); "
            "let more error be worth as much force"
        )
    weight = (worth.position / worth.force) ** 2
    manoeuvre = StepManoeuvre(speed, Limits(jerk))
    percent = best_acceleration(
        plant, found.kp, found.kd, weight, manoeuvre, PERIOD_S, held=PERIOD_S
    )
    return Design(usual, radius, _margin(loop, usual), percent)


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
