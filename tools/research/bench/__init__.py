"""`lindy bench`: every performance figure beside its baseline, both measured in this run.

A section is a module here with `figures() -> list[Figure]` and a row in SECTIONS.
"""

from importlib import import_module
from typing import Annotated

from cyclopts import Parameter

from services.runtime.config.errors import LindyError
from tools.research.bench.table import Figure, as_json, show

SECTIONS = {
    "reference": "tools.research.bench.reference",
    "estimation": "tools.research.bench.estimation",
    "heading": "tools.research.bench.heading",
    "horizontal": "tools.research.bench.horizontal",
    "control": "tools.research.bench.control",
    "hulls": "tools.research.bench.hulls",
    "other_hulls": "tools.research.bench.other_hulls",
    "simulator": "tools.research.bench.simulator",
    "simulate": "tools.research.bench.simulate",
    "tether": "tools.research.bench.tether",
    "sweep": "tools.research.bench.sweep",
    "identify": "tools.research.bench.identify",
    "dive": "tools.research.bench.dive",
    "onboard": "tools.research.bench.onboard",
    "fleet": "tools.research.bench.fleet",
    "transport": "tools.research.bench.transport",
    "mavlink": "tools.research.bench.mavlink",
    "camera": "tools.research.bench.camera",
    "cockpit": "tools.research.bench.cockpit",
    "busy": "tools.research.bench.busy",
    "ardusub": "tools.research.bench.ardusub",
}
QUICK = ("hulls", "other_hulls")  # sections that can fly fewer dives


def bench(
    *,
    only: Annotated[tuple[str, ...], Parameter(negative=())] = (),
    json: Annotated[bool, Parameter(negative=(), show_default=False)] = False,
    quick: Annotated[bool, Parameter(negative=(), show_default=False)] = False,
) -> int:
    """Measure Lindy's speed beside other ways of doing the same, as ratios with their goals.

    Example: lindy bench --only reference --json

    Parameters
    ----------
    only
        sections to run, repeatable; all if left out
    json
        print JSON instead of a table
    quick
        fewer dives in the sections that fly many
    """
    for name in only:
        if name not in SECTIONS:
            raise LindyError(f"--only {name}: no such section; there are {', '.join(SECTIONS)}")
    figures: list[Figure] = []
    for name in only or SECTIONS:
        options = {"quick": True} if quick and name in QUICK else {}
        figures += import_module(SECTIONS[name]).figures(**options)
    if json:
        print(as_json(figures))
    else:
        show(figures)
    return 0
