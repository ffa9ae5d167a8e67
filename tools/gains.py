"""`lindy gains`: the control gains of an axis, from what an error is worth."""

from typing import Annotated

import numpy as np
from cyclopts import Parameter

from services.control.axis.axis import WIDEST
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.choices import Overrides, VehicleName
from tools.tuning.lq import USUAL_TURN, USUAL_WAY, LoopName, design, lines


def gains(
    axis: LoopName,
    /,
    *,
    vehicle: VehicleName = "pioneer",
    error: Annotated[float | None, Parameter(help="[m] or [rad]")] = None,
    rate: Annotated[float | None, Parameter(help="[m/s] or [rad/s]")] = None,
    force: Annotated[float | None, Parameter(help="[N] or [N m]")] = None,
    observer: Annotated[
        float,
        Parameter(help="[rad/s] of a disturbance observer, at most 50, checked with the rest"),
    ] = 0.0,
    set_: Overrides = (),
) -> int:
    """Find control gains for an axis of a vehicle (LQ).

    Printed for the vehicle's file. An error as large as --error, a rate as large as --rate and a
    force as large as --force are equally bad. Left out, they are 5 cm, 10 cm/s and 5 N; of the
    heading 3 deg, 10 deg/s and 0.4 N m.

    Example: lindy gains depth --error 0.1 --force 8 --observer 3
    """
    given = {"error": error, "rate": rate, "force": force}
    for name, value in given.items():
        if value is not None and not 0.0 < value < 1e6:
            raise LindyError(f"--{name} is {value:g}, expected more than 0 and less than 1e6")
    if not 0.0 <= observer <= WIDEST:
        raise LindyError(f"--observer is {observer:g}, expected 0 to {WIDEST:g} rad/s")
    usual = USUAL_TURN if axis == "heading" else USUAL_WAY
    worth = usual._replace(
        position=error or usual.position,
        velocity=rate or usual.velocity,
        force=force or usual.force,
    )
    stack = Stack(vehicle=vehicle, overrides=list(set_))
    stack.check(known_tables(Registry.read()))
    try:
        with np.errstate(all="ignore"):
            found = design(stack.section("vehicle", Vehicle), axis, worth, observer)
    except ValueError as why:
        raise LindyError(f"--error, --rate and --force: {why}; choose nearer ones") from None
    print("\n".join(lines(axis, found, worth)))
    return 0
