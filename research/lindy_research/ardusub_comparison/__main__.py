"""python -m lindy_research.ardusub_comparison --out docs/ardusub (writes docs/ardusub.png)"""

import argparse
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from lindy_research.ardusub_comparison.figure import draw, summary, table
from lindy_research.ardusub_comparison.flights import fly_alt_hold, fly_lindy, fly_shipped
from lindy_research.ardusub_comparison.station_keeping import (
    keep_with_lindy,
    keep_with_poshold,
    table_of,
)
from lindy_research.ardusub_comparison.sticks import drawn, judged

PILOTS = {"lindy": fly_lindy, "shipped": fly_shipped, "alt_hold": fly_alt_hold}
STATIONS = {"lindy": keep_with_lindy, "poshold": keep_with_poshold}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m lindy_research.ardusub_comparison")
    parser.add_argument("--out", default="ardusub", help="of the figure, without .png")
    parser.add_argument("--drawn", type=int, metavar="SEED", help="random releases, and no figure")
    parser.add_argument("--rounds", type=int, default=2, help="of six random releases each")
    parser.add_argument("--pilot", choices=[*PILOTS, "poshold"], help="else all")
    parser.add_argument("--stations", action="store_true", help="hold a place in a current instead")
    parser.add_argument("--keep", help="a new folder for the recordings; else they are deleted")
    said = parser.parse_args()
    path = os.environ.get("LINDY_ARDUSUB", "").partition(":")[0]
    if not path:
        print("LINDY_ARDUSUB names no firmware; docs/ardusub.md says what it is", file=sys.stderr)
        return 2
    with TemporaryDirectory() as temporary:
        folder = Path(said.keep or temporary)
        if said.stations:
            for name, keep in STATIONS.items():
                if said.pilot in (None, name):
                    print(table_of(keep(path, folder / f"{name}_station")), flush=True)
            return 0
        if said.drawn is not None:
            moves = drawn(said.drawn, said.rounds)
            for name, fly in PILOTS.items():
                if said.pilot in (None, name):
                    print(table(fly(path, moves, folder / f"{name}_{said.drawn}")), flush=True)
            return 0
        flights = [
            fly_alt_hold(path, judged(), folder / "alt_hold"),
            fly_lindy(path, judged(), folder / "lindy"),
        ]
    for flight in flights:
        print(summary(flight))
    draw(flights, Path(f"{said.out}.png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
