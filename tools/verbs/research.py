"""Verbs of tools/research, which is not in an installed package."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tools.choices import named


def bench(
    *,
    only: Annotated[
        tuple[str, ...], Parameter(negative=(), show_default=False, help="a section; repeatable")
    ] = (),
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="no table, JSON")
    ] = False,
    quick: Annotated[
        bool, Parameter(negative=(), show_default=False, help="fewer dives where it flies many")
    ] = False,
) -> int:
    """Compare Lindy's speed with other implementations, as ratios with their goals.

    Example: lindy bench --only reference --json
    """
    from tools.research.bench import bench

    return bench(only=only, json=json, quick=quick)


def figures(
    *,
    out: Annotated[Path, Parameter(converter=named)],
    only: Annotated[
        tuple[str, ...], Parameter(negative=(), consume_multiple=True, show_default=False)
    ] = (),
) -> int:
    """Draw the two papers' figures on references and control, and check their numbers.

    Example: lindy figures --out figures --only andren-4.2 fernandes-10

    Writes ID.png and ID.svg for each figure, and claims.json: each claim with the paper's value,
    ours, and a verdict. The same files, byte for byte, on every run.

    Args:
        out: folder, made if it is not there; where it holds such files already, a new one beside
            it.
        only: ids of figures to draw, instead of all; claims.json is written in any case, with
            claims about flights (fernandes-6 to 8, 14 to 17) only where one of these is drawn.
    """
    from tools.research.papers.command import figures

    return figures(out=out, only=only)
