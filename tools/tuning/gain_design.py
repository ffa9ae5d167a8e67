"""The best gains of an axis for what an error is worth, checked in the loop as it runs."""

from typing import Literal, NamedTuple

from msgspec.structs import replace

from services.control.axis.axis import Gains
from services.control.axis.plant import Plant, lags_of, plant_of
from services.control.core import PERIOD_S
from services.control.stability import ROWS, SampledLoop, sampled_loop
from services.marine.vehicle import Vehicle
from services.reference.trajectory.minimum_jerk import Limits
from services.runtime.config.errors import LindyError
from tools.tuning.lq import StepManoeuvre, Worth, best_acceleration, feedback

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
