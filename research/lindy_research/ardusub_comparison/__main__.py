"""python -m lindy_research.ardusub_comparison --out docs/ardusub (writes docs/ardusub.png)"""

import argparse
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from lindy_research.ardusub_comparison.figure import draw, summary
from lindy_research.ardusub_comparison.flights import fly_alt_hold, fly_lindy
from lindy_research.ardusub_comparison.sticks import judged, practice


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m lindy_research.ardusub_comparison")
    parser.add_argument("--out", default="ardusub", help="of the figure, without .png")
    parser.add_argument(
        "--practice",
        choices=["lindy", "alt_hold"],
        help="one flight with other sticks, without a figure: for trying settings",
    )
    parser.add_argument("--keep", help="a new folder for the recordings; else they are deleted")
    said = parser.parse_args()
    path = os.environ.get("LINDY_ARDUSUB", "").partition(":")[0]
    if not path:
        print("LINDY_ARDUSUB names no firmware; docs/ardusub.md says what it is", file=sys.stderr)
        return 2
    with TemporaryDirectory() as temporary:
        folder = Path(said.keep or temporary)
        if said.practice:
            fly = fly_lindy if said.practice == "lindy" else fly_alt_hold
            print(summary(fly(path, practice(), folder / said.practice)))
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
