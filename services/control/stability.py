"""Unstable gains are refused before they reach a thruster."""

from math import tau

from services.control.allocation.propulsion import lags_of
from services.control.axis.axis_law import Gains, StaticGains
from services.control.axis.plant import plant_of
from services.control.axis.sampled_loop import SampledLoop
from services.control.settings import Settings
from services.marine.vehicle import Vehicle

ROWS = {"surge": 0, "sway": 1, "depth": 2, "heading": 5}
# [Hz] Of the low-pass of the yaw rate, YAW_RATE_CUTOFF in services/estimation/core.py.
YAW_RATE_CUTOFF = 8.0
ROUNDING = 1e-9  # [-] a loop without spring has an eigenvalue of exactly 1, give or take this


def sampled_loop(vehicle: Vehicle, axis: str, period: float) -> SampledLoop:
    """The loop of an axis of `ROWS`, which is stepped each `period` [s]."""
    row = ROWS[axis]
    rate_lag = 1.0 / (tau * YAW_RATE_CUTOFF) if axis == "heading" else 0.0
    return SampledLoop(plant_of(vehicle, row), lags_of(vehicle)[row], period, rate_lag)


def require_stable(settings: Settings, vehicle: Vehicle, period: float) -> None:
    """
    Args:
        period: [s] of the loop.

    Raises:
        ValueError: names the table, its gains and the largest eigenvalue.
    """
    for name in ROWS:
        gains: Gains = getattr(settings, name)
        loop = sampled_loop(vehicle, name, period)
        _require(f"control.{name}", loop, gains, gains)
        if gains.static is not None:
            _require(f"control.{name}.static", loop, gains, gains.static)


def _require(table: str, loop: SampledLoop, gains: Gains, feedback: Gains | StaticGains) -> None:
    radius = loop.radius(gains, feedback)
    if radius <= 1.0 + ROUNDING:
        return
    learns = f"observer = {gains.observer:g}" if gains.observer else f"ki = {gains.ki:g}"
    raise ValueError(
        f"{table}: with kp = {feedback.kp:g}, kd = {feedback.kd:g} and {learns} the loop at "
        f"{1 / loop.period:g} Hz is not stable on this vehicle: its largest eigenvalue is "
        f"{radius:.4f}, allowed is 1"
    )
