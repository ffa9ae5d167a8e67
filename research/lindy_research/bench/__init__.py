"""`lindy bench`: every performance figure beside its baseline, both measured in this run.

A section is a module here with `figures() -> list[Figure]` and a row in SECTIONS.
"""

import sys
from importlib import import_module
from typing import Annotated

from cyclopts import Parameter

from lindy.api import LindyError
from lindy_research.bench.table import show

SECTIONS = {
    "reference": "lindy_research.bench.reference",
    "estimation": "lindy_research.bench.estimation",
    "heading": "lindy_research.bench.heading",
    "horizontal": "lindy_research.bench.horizontal",
    "position": "lindy_research.bench.position",
    "control": "lindy_research.bench.control",
    "hulls": "lindy_research.bench.hulls",
    "other_hulls": "lindy_research.bench.other_hulls",
    "reality": "lindy_research.bench.reality",
    "simulator": "lindy_research.bench.simulator",
    "simulate": "lindy_research.bench.simulate",
    "tether": "lindy_research.bench.tether",
    "sweep": "lindy_research.bench.sweep",
    "identify": "lindy_research.bench.identify",
    "dive": "lindy_research.bench.dive",
    "onboard": "lindy_research.bench.onboard",
    "transport": "lindy_research.bench.transport",
    "mavlink": "lindy_research.bench.mavlink",
    "camera": "lindy_research.bench.camera",
    "film": "lindy_research.bench.film",
    "busy": "lindy_research.bench.busy",
}
QUICK = ("hulls", "other_hulls", "reality", "position")  # sections that can fly fewer dives


def bench(
    *,
    only: Annotated[tuple[str, ...], Parameter(help="a section; repeatable")] = (),
    quick: Annotated[bool, Parameter(help="fewer dives where it flies many")] = False,
) -> int:
    """Compare speed with other implementations.

    It measures both in this run, and prints ratios with their goals.

    Example: lindy bench --only reference
    """
    for name in only:
        if name not in SECTIONS:
            raise LindyError(f"--only {name}: no such section; there are {', '.join(SECTIONS)}")
    for name in only or SECTIONS:
        print(f"measuring {name}", file=sys.stderr, flush=True)  # of minutes each
        options = {"quick": True} if quick and name in QUICK else {}
        found = import_module(SECTIONS[name]).figures(**options)
        show(found)
    return 0
