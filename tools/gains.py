"""`lindy gains`: the control gains of an axis, from what an error is worth."""

from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from services.control.axis.axis import WIDEST
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.choices import Overrides, VehicleName
from tools.tuning.lq import Worth, design, lines

# Error, rate, force; speed and jerk of the trial manoeuvre.
USUAL_WAY = (0.05, 0.1, 5.0, 0.3, 1.5)  # [m]
USUAL_TURN = (0.052, 0.175, 0.4, 0.5, 4.0)  # [rad]


def gains(
    axis: Literal["depth", "heading", "surge", "sway"],
    /,
    *,
    vehicle: VehicleName = "pioneer",
    error: Annotated[float | None, Parameter(help="[m] or [rad]")] = None,
    rate: Annotated[float | None, Parameter(help="[m/s] or [rad/s]")] = None,
    force: Annotated[float | None, Parameter(help="[N] or [N m]")] = None,
    patience: Annotated[
        float, Parameter(help="[s] for which such an error may last; smaller makes ki larger")
    ] = 5.0,
    observer: Annotated[
        float,
        Parameter(help="[rad/s] of a disturbance observer, at most 50, checked with the rest"),
    ] = 0.0,
    speed: Annotated[
        float | None,
        Parameter(help="[m/s] or [rad/s] at which drag is made linear, and of the trial manoeuvre"),
    ] = None,
    jerk: Annotated[
        float | None, Parameter(help="[m/s³] or [rad/s³] of the trial manoeuvre")
    ] = None,
    set_: Overrides = (),
) -> int:
    """Find control gains for an axis of a vehicle (LQ).

    Printed for the vehicle's file. An error as large as --error, a rate as large as --rate and a
    force as large as --force are equally bad. Left out, they are 5 cm, 10 cm/s and 5 N; of the
    heading 3 deg, 10 deg/s and 0.4 N m.

    Example: lindy gains depth --error 0.1 --force 8 --observer 3
    """
    turns = axis == "heading"
    usual = USUAL_TURN if turns else USUAL_WAY
    asked = (error, rate, force, speed, jerk)
    numbers = [
        given if given is not None else default for given, default in zip(asked, usual, strict=True)
    ]
    for name, value in zip(("error", "rate", "force", "speed", "jerk"), numbers, strict=True):
        _positive(name, value)
    _positive("patience", patience)
    if not 0.0 <= observer <= WIDEST:
        raise LindyError(f"--observer is {observer:g}, expected 0 to {WIDEST:g} rad/s")
    position, velocity, effort, fast, sharp = numbers
    stack = Stack(vehicle=vehicle, overrides=list(set_))
    stack.check(known_tables(Registry.read()))
    worth = Worth(position, velocity, effort, patience)
    try:
        with np.errstate(all="ignore"):
            found = design(stack.section("vehicle", Vehicle), axis, worth, observer, fast, sharp)
    except ValueError as why:
        raise LindyError(f"--error, --rate and --force: {why}; choose nearer ones") from None
    print("\n".join(lines(axis, found, worth)))
    return 0


def _positive(name: str, value: float) -> None:
    if not 0.0 < value < 1e6:
        raise LindyError(f"--{name} is {value:g}, expected more than 0 and less than 1e6")
