"""The head-up numbers of a pilot's window: what stands where, and how urgent it is. Pure.

Drawing them is somebody else's work: these are words, in rows, each cell with its tone.
"""

from typing import Literal, NamedTuple

from services.piloting import view_words
from services.piloting.pilot_view import PilotView
from services.piloting.view_words import known, number

Tone = Literal["plain", "good", "warning", "alarm"]
Size = Literal["big", "small"]


class Cell(NamedTuple):
    label: str  # in small letters above it; empty: none
    text: str
    tone: Tone = "plain"


class NumbersRow(NamedTuple):
    """Cells of the same width, side by side."""

    cells: tuple[Cell, ...]
    size: Size = "small"


def head_up(view: PilotView) -> list[NumbersRow]:
    """Always the same rows in the same places, so that a pilot finds each without searching."""
    old = view_words.old(view)
    tone: Tone = "warning" if old or view.depth_m is None else "plain"
    heading_tone: Tone = "warning" if old or view.heading_deg is None else "plain"
    return [
        NumbersRow((_armed(view), _mode(view)), "big"),
        NumbersRow(
            (
                Cell("depth [m]", number(view.depth_m, ".2f"), tone),
                Cell("heading [°]", number(view.heading_deg, ".1f"), heading_tone),
            ),
            "big",
        ),
        NumbersRow(
            (
                Cell("", f"reference {number(view.depth_wanted_m, '.2f')}"),
                Cell("", f"reference {number(view.heading_wanted_deg, '.1f')}"),
            ),
        ),
        NumbersRow(
            (
                Cell("battery", view_words.battery(view)),
                Cell("light", view_words.light(view)),
            ),
        ),
        NumbersRow((_link(view), _age(view, old))),
        NumbersRow((_said(view),)),
    ]


def _armed(view: PilotView) -> Cell:
    tone: Tone = "warning" if view.last_known else "good" if view.armed else "plain"
    return Cell("last known" if view.last_known else "", view_words.armed(view), tone)


def _mode(view: PilotView) -> Cell:
    return Cell(f"hold: {view_words.hold(view)}", view.mode)


def _link(view: PilotView) -> Cell:
    delay = f"{number(view.rtt_ms, '.0f')} ms"
    return Cell("link, round trip", delay, "alarm" if view.alarm else "plain")


def _age(view: PilotView, old: str) -> Cell:
    age = f"{number(view.age_ms, '.0f')} ms"
    return Cell("age of depth and heading", old or age, "warning" if old else "plain")


def _said(view: PilotView) -> Cell:
    """Sentences, the gravest first: what the drone does by itself, the link's alarm, the note."""
    words = f"{known(view)}{view.words}" if view.words else ""
    acts = ": ".join(filter(None, (view_words.failsafe(view), words)))
    alarms = [*filter(None, (acts, f"LINK {view.alarm}" if view.alarm else ""))]
    said = "; ".join(filter(None, (*alarms, view.note)))
    return Cell("", said, "alarm" if alarms else "warning")
