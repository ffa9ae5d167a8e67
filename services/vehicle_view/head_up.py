"""The head-up numbers of a pilot's window: what stands where, and how urgent it is. Pure.

Drawing them is somebody else's work: these are words, in rows, each cell with its tone.
"""

from typing import Literal, NamedTuple

from services.vehicle_view import words
from services.vehicle_view.view import VehicleView
from services.vehicle_view.words import Tone, number

Size = Literal["big", "small"]


class Cell(NamedTuple):
    label: str  # in small letters above it; empty: none
    text: str
    tone: Tone = "plain"


class NumbersRow(NamedTuple):
    """Cells of the same width, side by side."""

    cells: tuple[Cell, ...]
    size: Size = "small"


def head_up(view: VehicleView) -> list[NumbersRow]:
    """Always the same rows in the same places, so that a pilot finds each without searching."""
    old = words.old(view)
    depth: Tone = "warning" if old or view.depth_m is None else "plain"
    heading: Tone = "warning" if old or view.heading_deg is None else "plain"
    armed: Tone = "warning" if view.armed or view.last_known else "plain"
    said = words.said(view)
    alarm = any(each.tone == "alarm" for each in said)
    return [
        NumbersRow(
            (
                Cell("last known" if view.last_known else "", words.armed(view), armed),
                Cell(f"flight mode: {words.flight_mode(view)}", words.doing(view)),
            ),
            "big",
        ),
        NumbersRow(
            (
                Cell("depth [m]", number(view.depth_m, ".2f"), depth),
                Cell("heading [°]", number(view.heading_deg, ".1f"), heading),
            ),
            "big",
        ),
        NumbersRow(
            (
                Cell("", f"reference {number(view.depth_wanted_m, '.2f')}"),
                Cell("", f"reference {number(view.heading_wanted_deg, '.1f')}"),
            ),
        ),
        NumbersRow(tuple(Cell(label, text) for label, text in words.numbers(view))),
        NumbersRow(
            (
                Cell(
                    "link, round trip",
                    f"{number(view.rtt_ms, '.0f')} ms",
                    "alarm" if view.alarm else "plain",
                ),
                Cell(
                    "age of depth and heading",
                    old or f"{number(view.age_ms, '.0f')} ms",
                    "warning" if old else "plain",
                ),
            )
        ),
        NumbersRow(
            (Cell("", "; ".join(each.text for each in said), "alarm" if alarm else "warning"),)
        ),
    ]
