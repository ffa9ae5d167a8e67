"""`python -m lindy_research.scale`: print research/measurements/scale.md, or measure its
points anew.

`make docs` writes the page.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec

from lindy_research.scale.measure import FLEETS, JOINING, measured_join, measured_point
from lindy_research.scale.page import POINTS, MeasuredScale, page

PAGE = Path(__file__).parents[2] / "measurements" / "scale.md"


def main(words: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="scale", description=__doc__)
    parser.add_argument("--measure", action="store_true", help=f"some minutes; writes {POINTS}")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE}")
    args = parser.parse_args(words)
    if args.measure:
        load = os.getloadavg()[0]
        found = MeasuredScale(
            f"{len(os.sched_getaffinity(0))} cores, load {load:.1f} from others at the start",
            [measured_point(*fleet) for fleet in FLEETS],
            [measured_join(*joining) for joining in JOINING],
        )
        POINTS.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n")
    if args.write:
        PAGE.write_text(page(), encoding="utf-8")
    else:
        print(page())


if __name__ == "__main__":
    main(sys.argv[1:])
