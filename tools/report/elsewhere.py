"""Lists what the report of one machine lacks because only the other machine recorded it."""

from collections.abc import Sequence
from typing import NamedTuple

from tools.report.report import Report
from tools.report.summary import lined_up


class Elsewhere(NamedTuple):
    """The other machine."""

    side: str  # topside or drone
    services: tuple[str, ...]  # services whose home side it is


def elsewhere(report: Report, other: Elsewhere) -> str:
    """One sentence, as a row of the summary."""
    silent = [name for name in other.services if name not in report.services]
    if len(silent) == len(other.services):
        text = f"the {other.side} was never heard: nothing of it is in this report"
        return lined_up([("elsewhere", text)])
    text = f"the {other.side}'s restarts, and its messages that never arrived, are not in here"
    if unknown := _unknown(report):
        text += f"; not known here: {in_a_row(unknown)}"
    if silent:
        text += f"; never heard: {in_a_row(silent)}"
    return lined_up([("elsewhere", text)])


def in_a_row(names: Sequence[str]) -> str:
    """a, b and c"""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _unknown(report: Report) -> list[str]:
    """Figures that come from the topside's messages and did not arrive."""
    figures = {
        "stick to thruster": report.latency_ms.stick_to_thruster.p50,
        "sensor to screen": report.budget_ms.sensor_to_screen,
        "the clock offset": report.clocks.offset_ms,
    }
    return [name for name, value in figures.items() if value is None]
