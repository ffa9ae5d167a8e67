"""Filter updates by DVL and USBL samples, as functions of (estimate, interval).

Bind the leading arguments with `functools.partial`; the buffer repeats the updates when a late
sample arrives.
"""

from collections.abc import Callable

from messages.units import Vec3
from services.estimation.horizontal import horizontal_filter as ekf
from services.estimation.horizontal.horizontal_filter import (
    HorizontalEstimate,
    Innovation,
    Interval,
    Pair,
)

MeasurementModel = Callable[[HorizontalEstimate, Interval], Innovation]


def velocity(
    measured: Vec3, std: float, estimate: HorizontalEstimate, interval: Interval
) -> Innovation:
    """Of a DVL: [m/s] FRD over the ground, with the std of each component."""
    return ekf.velocity(estimate, interval, measured, std)


def position(measured: Pair, std: float, estimate: HorizontalEstimate, _: Interval) -> Innovation:
    """Of a USBL: [m] north and east, with the std of each component."""
    return ekf.fix(estimate, measured, std)


def update(
    model: MeasurementModel, estimate: HorizontalEstimate, interval: Interval
) -> HorizontalEstimate:
    """Measurement update."""
    return ekf.corrected(estimate, model(estimate, interval))


def set_velocity(
    measured: Vec3, std: float, estimate: HorizontalEstimate, interval: Interval
) -> HorizontalEstimate:
    """Restart of the velocity."""
    return ekf.changed_to(estimate, interval, measured, std)


def set_position(
    measured: Pair, std: float, estimate: HorizontalEstimate, _: Interval
) -> HorizontalEstimate:
    """Restart of the position."""
    return ekf.moved_to(estimate, measured, std)
