"""The table of `hulls` for the other vehicles, with goals scaled by their thrust per inertia."""

from lindy_research.bench import hulls
from lindy_research.bench.table import Figure

SEEDS, QUICK_SEEDS = 6, 1


def figures(*, quick: bool = False) -> list[Figure]:
    """
    Args:
        quick: one seed instead of 6.
    """
    seeds = QUICK_SEEDS if quick else SEEDS
    return [
        figure
        for vehicle in ("bluerov2_heavy", "minerva")
        for figure in hulls.table(vehicle, seeds, "other_hulls")
    ]
