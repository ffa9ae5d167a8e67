"""The verb `lindy identify`."""

import sys
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, cast

from cyclopts import App, Parameter

from services.marine.vehicle import Vehicle
from services.reference.settings import Settings
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.choices import Overrides, VehicleName, named
from tools.fresh import refuse_existing, write_fresh
from tools.identify import motion_model
from tools.identify import plan as planning
from tools.identify.identify import compare, identify_dive, proposed, read_dive
from tools.identify.results import as_table, identified, remarks, rows, thrust_scale
from tools.identify.vehicle_file import rewritten, rounded

identify = App(name="identify", help="Find inertia, drag, buoyancy and lag in a dive.")

AxesOption = Annotated[str, Parameter(help="of heave, yaw, surge and sway, with commas between")]
VehicleOption = Annotated[
    str | None, Parameter(help="file to begin from; default: that in the recording")
]


@identify.command(name="plan")
def plan_(
    *,
    out: Annotated[Path, Parameter(converter=named, help="the stick log to write, a new file")],
    vehicle: VehicleName = "pioneer",
    axes: AxesOption = "heave,yaw",
    depth: Annotated[float, Parameter(help="[m] in the middle of the manoeuvres")] = 3.0,
    strength: Annotated[float, Parameter(help="0.1 … 1 of full stick")] = 1.0,
    set_: Overrides = (),
) -> int:
    """Write the manoeuvres that make a vehicle's numbers visible, as a stick log to be flown.

    Says how much water and time they need. While they are flown, STOP works as in every dive.

    Example: lindy identify plan --vehicle pioneer --out sticks.csv
             lindy dive --pilot script:sticks.csv --out dives/identify
             lindy identify dives/identify --out mine.toml
    """
    if not 0.1 <= strength <= 1.0:
        raise LindyError(f"--strength is {strength:g}, expected 0.1 to 1")
    if not 0.0 < depth <= 1000.0:
        raise LindyError(f"--depth is {depth:g}, expected more than 0, at most 1000 m")
    stack = Stack(vehicle=vehicle, overrides=list(set_))
    hull = stack.section("vehicle", Vehicle)
    wanted = cast(Any, _axes(axes, planning.AXES))
    found = planning.plan(hull, stack.section("reference", Settings), wanted, depth, strength)
    write_fresh(out, planning.as_csv(found, hull).encode())
    print(f"{out}: {planning.told(found)}")
    return 0


@identify.default
def recording_(
    recording: Path,
    /,
    *,
    out: Annotated[
        Path | None, Parameter(converter=named, help="a new vehicle file with the fitted numbers")
    ] = None,
    axes: AxesOption = "heave,yaw,surge,sway",
    vehicle: VehicleOption = None,
    net_buoyancy: Annotated[
        float | None, Parameter(help="[N] as weighed in water: tells the scale of the thrust, too")
    ] = None,
    check: Annotated[
        Path | None, Parameter(help="another dive, which both vehicle files predict")
    ] = None,
) -> int:
    """Fit a vehicle's numbers to a recorded dive, with their deviations.

    RECORDING is a dive's folder or its MCAP file. An axis that the dive does not tell enough of
    keeps the numbers of the vehicle file.

    Example: lindy identify dives/latest --out mine.toml --check dives/other
    """
    if net_buoyancy is not None and not (isfinite(net_buoyancy) and net_buoyancy != 0.0):
        raise LindyError(f"--net-buoyancy is {net_buoyancy:g}, expected a number of N other than 0")
    if out is not None:
        refuse_existing(out)
    if sys.stderr.isatty():
        print("lindy: reads and fits, which may take minutes", file=sys.stderr, flush=True)
    found = identify_dive(recording, vehicle, _axes(axes, motion_model.AXES))
    exact = identified(found.fit, found.start)
    scale = None if net_buoyancy is None else thrust_scale(found.fit, net_buoyancy)
    notes = list(remarks(found.fit, exact, scale))
    new = rounded(exact)
    gains = proposed(new, found.fit.axes, found.file.tree)
    compared = None
    if check is not None:
        other = read_dive(check, found.file)
        compared = compare(other, found.file.vehicle, new, found.file.wake_share, check)
    if out is not None:
        why = f"identified from {recording.resolve().name}"
        text = rewritten(found.file, new, why) + "\n" + "".join(f"# {line}\n" for line in gains)
        write_fresh(out, text.encode())
    print("\n".join([as_table(list(rows(found.fit, found.start))), "", *notes, "", *gains]))
    if compared is not None:
        before, after = compared.before, compared.after
        print(
            f"\n{check}, {compared.stretches} times {compared.seconds:g} s predicted: depth rate "
            f"to {after.depth_rate:.3g} m/s, {after.depth_rate / before.depth_rate:.2f} times "
            f"the error of {found.file.name}; yaw rate to {after.yaw_rate:.3g} rad/s, "
            f"{after.yaw_rate / before.yaw_rate:.2f} times"
        )
    return 0


def _axes(text: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """
    Raises:
        LindyError: a name is not known, or there twice.
    """
    names = tuple(name.strip() for name in text.split(","))
    if not set(names) <= set(known) or len(set(names)) < len(names):
        raise LindyError(f"--axes {text}: expected some of {','.join(known)}, each once")
    return names
