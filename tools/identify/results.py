"""The fitted numbers beside those of the vehicle file: in a table, as a vehicle."""

from collections.abc import Iterator
from math import exp, sqrt
from typing import NamedTuple

from msgspec.structs import replace

from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import Vehicle
from tools.identify.fit import NOT_MOVED, Fit, drag_at
from tools.identify.motion_model import (
    AXES,
    BUOYANCY,
    LAG,
    ROWS,
    Beginning,
    inertia_of,
    linear_of,
    quadratic_of,
    vehicle_of,
)

NOT_WHITE = 1.5  # [-] enlargement of deviations that is worth a remark
SURE = 1.96  # [-] deviations to each side: 95 % of a normal distribution
ASSUMED = (
    "thrust is what the vehicle file makes of the commands: if it is 5 % more, so are all the "
    "numbers but the lag"
)


class ResultRow(NamedTuple):
    name: str
    unit: str
    value: float
    std: float
    file: float  # of the vehicle file


class ThrustScale(NamedTuple):
    """[-] Real thrust over that of the vehicle file, from a net buoyancy that was weighed."""

    value: float
    std: float


def rows(found: Fit, start: Beginning) -> Iterator[ResultRow]:
    """Only what was fitted."""
    std = [sqrt(max(0.0, v)) for v in found.covariance.diagonal().tolist()]
    file = start.vehicle
    for name in found.axes:
        axis = AXES.index(name)
        row, turns = ROWS[axis], name == "yaw"
        m, d, q = inertia_of(axis), linear_of(axis), quadratic_of(axis)
        mass, force, per = ("kg m²", "N m", "rad") if turns else ("kg", "N", "m")
        value = exp(found.x[m])
        inertia = system_inertia(file)[row]
        yield ResultRow(f"{name} inertia", mass, value, value * std[m], inertia)
        for label, unit, index, scale, own in (
            ("linear", f"{force} s/{per}", d, start.linear[axis], file.linear_damping),
            ("quadratic", f"{force} s²/{per}²", q, start.quadratic[axis], file.quadratic_damping),
        ):
            drag, deviation = found.x[index] * scale, std[index] * scale
            yield ResultRow(f"{name} {label} drag", unit, drag, deviation, own[row])
        speed = float(found.speed[axis])
        drag, deviation = drag_at(start, found.x, found.covariance, axis, speed)
        own, _ = drag_at(start, start.vector, found.covariance, axis, speed)
        yield ResultRow(f"{name} drag at {speed:.2g} {per}/s", force, drag, deviation, own)
    if "heave" in found.axes:
        yield ResultRow(
            "net buoyancy", "N", float(found.x[BUOYANCY]), std[BUOYANCY], file.net_buoyancy
        )
    if found.lag:
        lag = exp(found.x[LAG])
        yield ResultRow("thruster lag", "s", lag, lag * std[LAG], exp(start.vector[LAG]))


def identified(found: Fit, start: Beginning) -> Vehicle:
    """The vehicle file's vehicle with the fitted numbers. Added mass may be negative."""
    vehicle = vehicle_of(start, found.x, found.axes)
    if not found.lag:
        return vehicle
    lag = exp(found.x[LAG])
    return replace(
        vehicle, thruster=[replace(thruster, time_constant=lag) for thruster in vehicle.thruster]
    )


def thrust_scale(found: Fit, weighed: float) -> ThrustScale | None:
    """In heave the same fit holds for k times the thrust with k times the buoyancy, inertia and
    drag, so a known buoyancy [N] tells k. None: heave was not fitted."""
    value = float(found.x[BUOYANCY])
    if "heave" not in found.axes or value == 0.0:
        return None
    scale = weighed / value
    return ThrustScale(scale, abs(scale / value) * sqrt(found.covariance[BUOYANCY, BUOYANCY]))


def remarks(found: Fit, vehicle: Vehicle, scale: ThrustScale | None) -> Iterator[str]:
    """What to know about the numbers, a sentence each."""
    if scale is None:
        yield ASSUMED
    else:
        yield (
            f"with the net buoyancy as weighed, thrust is {scale.value:.3f} ± {scale.std:.3f} "
            "times the vehicle file's; the numbers are in newtons of the file all the same, as the "
            "commands are"
        )
    for name, (inertia, drag) in found.refused.items():
        if name == "lag":
            yield f"thruster lag: kept as in the file; told to within {100 * inertia:.0f} % only"
        else:
            yield f"{name}: kept as in the file; {weakly(inertia, drag)}"
    if found.inflation.max() > NOT_WHITE:
        yield (
            f"the residuals are not white (deviations enlarged up to {found.inflation.max():.1f} "
            "times): something moved the vehicle that the model does not have, or the fit ended in "
            "a local optimum; fly once more and compare"
        )
    if found.unexplained:
        yield (
            f"{found.unexplained} windows left out, in which something else than the thrusters "
            "moved the vehicle"
        )
    for name in found.axes:
        row = ROWS[AXES.index(name)]
        if vehicle.added_mass[row] < 0.0:
            yield (
                f"{name}: the inertia is less than that of the dry vehicle in the file; check mass "
                "and thrust; the added mass is written as 0"
            )


def weakly(inertia: float, drag: float) -> str:
    """Why an axis is not fitted."""
    if (inertia, drag) == NOT_MOVED:
        return "the dive hardly moves along it"
    return (
        f"the dive tells its inertia to ± {100 * inertia:.0f} %, its drag to ± {100 * drag:.0f} %"
    )


def as_table(every: list[ResultRow]) -> str:
    """Value, standard deviation, file."""
    cells = [("", "value", "± std", "file", "")]
    cells += [
        (row.name, f"{row.value:.4g}", f"{row.std:.2g}", f"{row.file:.4g}", row.unit)
        for row in every
    ]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines: list[str] = []
    for name, value, std, file, unit in cells:
        numbers = [
            cell.rjust(width) for cell, width in zip((value, std, file), widths[1:4], strict=True)
        ]
        lines.append("  ".join([name.ljust(widths[0]), *numbers, unit]).rstrip())
    return "\n".join(lines)
