"""The modes in which faults happen: a vehicle, and what its pilot does before and meanwhile."""

from typing import NamedTuple

HEADING = "t,surge,sway,heave,yaw,tilt,event"


class FlownMode(NamedTuple):
    """Times are seconds after the pilot has taken the sticks."""

    name: str
    vehicle: str
    rows: tuple[str, ...]  # of the stick log, the last one lasting
    settled: float  # [s] then a fault begins
    holds_depth: bool = True
    vertical: str = "vertical"  # name of a vertical thruster
    depth_limit: float = 6.0  # [m] of the failsafe, within reach of the sticks
    lasts: float = 7200.0  # [s] until its last row

    @property
    def script(self) -> str:
        return "\n".join([HEADING, *self.rows, f"{self.lasts:.0f},0,0,0,0,,", ""])


# Two metres down with the stick, then rest; a stick that stays deflected shows a lost pilot.
DOWN = ("0,0,0,0,0,,", "0.5,0,0,1,0,,", "5,0,0,0,0,,")
DEEPER = ("0,0,0,0,0,,", "0.5,0,0,1,0,,", "17,0,0,0,0,,")
VERTICAL = "VERTICAL"  # of a fault: stands for the vehicle's
MODES = (
    FlownMode("manual", "pioneer", (*DOWN, "7,0.3,0,0,0,,mode manual"), 10.0, holds_depth=False),
    FlownMode("depth_hold", "pioneer", (*DOWN, "7,0.3,0,0,0,,mode depth_hold"), 10.0),
    FlownMode("stabilised", "pioneer", (*DOWN, "7,0.3,0,0,0,,"), 10.0),
    FlownMode(
        "station_keeping",
        "minerva",
        (*DOWN, "8,0,0,0,0,,mode station_keeping"),
        16.0,
        vertical="vertical_port",
        depth_limit=4.0,
    ),
    FlownMode(
        "follow",
        "minerva",
        (*DOWN, "8,0,0,0,0,,follow inspection_box"),
        16.0,
        vertical="vertical_port",
        depth_limit=4.0,
    ),
    FlownMode(
        "surfacing",
        "pioneer",
        (*DEEPER, "19,0,0,0,0,,goto depth=0.5"),
        21.0,
        depth_limit=11.0,
    ),
)
