"""Gains for an identified vehicle, as `lindy gains` finds them."""

from typing import Any

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from tools.gains import USUAL_TURN, USUAL_WAY
from tools.tuning.gain_design import LoopName, design, lines
from tools.tuning.lq import Worth

LOOP: dict[str, LoopName] = {
    "heave": "depth", "yaw": "heading", "surge": "surge", "sway": "sway",
}  # fmt: skip
PATIENCE = 5.0  # [s] as `lindy gains` has it


def proposed(vehicle: Vehicle, axes: tuple[str, ...], tree: dict[str, Any]) -> list[str]:
    """Lines of a vehicle file, as comments to be judged, for the loops of these axes.

    Args:
        tree: the vehicle file; its observers are kept.
    """
    found = ["Proposed gains (see `lindy gains`):"]
    for axis in axes:
        loop = LOOP[axis]
        error, rate, force, speed, jerk = USUAL_TURN if loop == "heading" else USUAL_WAY
        observer = float(tree.get("control", {}).get(loop, {}).get("observer", 0.0))
        worth = Worth(error, rate, force, PATIENCE)
        try:
            found += lines(loop, design(vehicle, loop, worth, observer, speed, jerk), worth)
        except LindyError as why:
            found.append(str(why))
    return found
