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
    return [*hulls.table("bluerov2_heavy", seeds), *hulls.table("minerva", seeds)]
