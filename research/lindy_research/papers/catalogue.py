"""The list of figures and of what is claimed about them. A new figure is a row here and a function
that draws it; new claims are a function that returns them."""

from collections.abc import Callable, Collection
from typing import NamedTuple

from matplotlib.figure import Figure

from lindy_research.papers import (
    claims_clamped,
    claims_comparison,
    claims_fernandes,
    claims_fernandes_loop,
    claims_full_stack,
    claims_rule,
    claims_simulation,
    disturbances,
    fernandes_loop,
    fernandes_model,
    fernandes_paths,
    fernandes_turns,
    full_stack_energy,
    headings,
    link_profiles,
    observers,
    style,
    thesis,
    thesis_clamped,
    thesis_comparison,
    thesis_experiments,
    thesis_simulations,
    thesis_sweeps,
    thesis_tables,
)
from lindy_research.papers.claims import Claim


class CatalogueEntry(NamedTuple):
    """One figure of a paper."""

    id: str  # also the name of its files
    source: str  # where it is in the paper
    title: str
    draw: Callable[[Figure], str]  # draws, and returns the caption
    width: float = 8.0  # [inch]
    height: float = 7.0  # [inch]


def _andren(
    number: str, title: str, draw: Callable[[Figure], str], height: float = 7.0
) -> CatalogueEntry:
    return CatalogueEntry(
        f"andren-{number}", f"Andrén 2023, figure {number}", title, draw, height=height
    )


def _andren_table(number: str, title: str, draw: Callable[[Figure], str]) -> CatalogueEntry:
    return CatalogueEntry(
        f"andren-table-{number}", f"Andrén 2023, Table {number}", title, draw, height=5.0
    )


def _fernandes(
    number: int, title: str, draw: Callable[[Figure], str], height: float
) -> CatalogueEntry:
    source = f"Fernandes et al. 2015, figure {number}"
    return CatalogueEntry(f"fernandes-{number}", source, title, draw, height=height)


FIGURES: tuple[CatalogueEntry, ...] = (
    _andren("4.2", "four references, small step", thesis_comparison.small_step, 8.0),
    _andren("4.3", "four references, large step", thesis_comparison.large_step, 8.0),
    _andren("5.1", "three initial accelerations, fixed time", thesis.initial_accelerations),
    _andren("5.2", "many initial velocities, fixed time", thesis.fixed_time_family),
    _andren("5.3", "recalculated on the way, fixed time", thesis.recalculated_fixed_time),
    _andren("5.4", "recalculated on the way, planned end jerk", thesis.recalculated_end_jerk),
    _andren("5.5", "many initial velocities, planned end jerk", thesis.end_jerk_family),
    _andren("5.6", "a stick that jumps", thesis.jumping_stick, 7.5),
    _andren("5.7", "position from piecewise plans", thesis.position_reference),
    _andren("5.8", "acceleration cut off", thesis_clamped.cut_off),
    _andren("5.9", "acceleration limit planned for", thesis_clamped.planned_for, 8.5),
    _andren("6.1", "a step of the stick, simulated", thesis_simulations.rectangle, 8.0),
    _andren("6.2", "shares of the acceleration feed-forward", thesis_sweeps.feed_forward, 8.5),
    _andren("6.3", "rise times", thesis_sweeps.rise_times, 8.5),
    _andren("6.4", "a pilot's log, simulated", thesis_simulations.pilots_log, 9.0),
    _andren("6.5", "depth, stick as reference", thesis_experiments.depth_naive, 8.0),
    _andren("6.6", "depth, minimum-jerk reference", thesis_experiments.depth_ramped, 8.0),
    _andren("6.7", "heading, stick as reference", thesis_experiments.heading_naive, 8.0),
    _andren("6.8", "heading, minimum-jerk reference", thesis_experiments.heading_ramped, 8.0),
    CatalogueEntry(
        "energy-dive",
        "Andrén 2023, section 6.2.3",
        "what a dive takes from the battery",
        full_stack_energy.first_dive,
        height=8.5,
    ),
    _andren_table("6.1", "a step of the stick", thesis_tables.of_the_step),
    _andren_table("6.2", "a pilot's log", thesis_tables.of_the_log),
    _fernandes(1, "shapes of the reference model", fernandes_model.shapes, 8.5),
    _fernandes(3, "twin clothoids against an arc", fernandes_turns.ratios, 4.6),
    _fernandes(4, "approximating path", fernandes_turns.approximating, 7.4),
    _fernandes(5, "interpolating path, two lane changes", fernandes_turns.interpolating, 5.6),
    _fernandes(6, "50 m north, where it was", fernandes_loop.figure_6, 9.0),
    _fernandes(7, "50 m north, velocities", fernandes_loop.figure_7, 8.0),
    _fernandes(8, "50 m north, commanded rotations", fernandes_loop.figure_8, 8.0),
    _fernandes(9, "three runs in a row", fernandes_model.three_runs, 6.5),
    _fernandes(10, "path of Table 4", fernandes_paths.plan_view, 5.8),
    _fernandes(11, "curvature of the path", fernandes_paths.curvature, 6.5),
    _fernandes(12, "path parameter over time", fernandes_paths.parameter, 6.5),
    _fernandes(13, "the five parts", fernandes_paths.five_parts, 6.0),
    _fernandes(14, "the path, flown", fernandes_loop.figure_14, 6.0),
    _fernandes(15, "the path, where it was", fernandes_loop.figure_15, 9.0),
    _fernandes(16, "the path, velocities", fernandes_loop.figure_16, 8.0),
    _fernandes(17, "the path, commanded forces", fernandes_loop.figure_17, 8.0),
    _fernandes(18, "optimal shapes", fernandes_model.optimal_shapes, 6.5),
    CatalogueEntry(
        "observer-disturbance",
        "Andrén 2023, section 6.1",
        "a step of the stick, with disturbance observers",
        disturbances.observed,
        height=8.5,
    ),
    CatalogueEntry(
        "observer-depth",
        "Andrén 2023, section 5.3.1",
        "a step in depth, four observers",
        observers.depth_step,
        height=8.5,
    ),
    CatalogueEntry(
        "observer-heading",
        "Andrén 2023, section 5.3.2",
        "heading through a magnetic disturbance",
        headings.disturbance,
        height=8.0,
    ),
    CatalogueEntry(
        "link-profiles",
        "Lindy and a naive peer",
        "one pilot's sticks over five links",
        link_profiles.five_links,
        width=11.0,
        height=11.0,
    ),
)

CLAIMS: tuple[Callable[[], list[Claim]], ...] = (
    claims_comparison.comparison_claims,
    claims_rule.rule_claims,
    claims_clamped.clamped_claims,
    claims_simulation.simulation_claims,
    claims_full_stack.full_stack_claims,
    claims_fernandes.fernandes_claims,
)


def checked_claims() -> list[Claim]:
    """Every claim that needs no flight, computed now."""
    return [claim for claims in CLAIMS for claim in claims()]


def flight_claims(drawn: Collection[str]) -> list[Claim]:
    """The claims about flights, computed for those of which a figure is drawn (by its id)."""
    return [
        claim
        for what in claims_fernandes_loop.FLOWN
        for claim in (
            claims_fernandes_loop.flown_claims(what)
            if any(id_ in drawn for id_ in what.figures)
            else claims_fernandes_loop.claims_not_flown(what)
        )
    ]


def drawn(entry: CatalogueEntry) -> Figure:
    """The finished figure, with title and caption."""
    with style.in_style():
        figure = style.sheet(entry.width, entry.height)
        caption = entry.draw(figure)
        style.finish(figure, f"{entry.source}: {entry.title}", caption)
    return figure
