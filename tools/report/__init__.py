"""The report of a dive: `report.json`, and the summary that a pilot reads."""

from tools.report.dive import Adding, GatheredDive, Passing, RecordedDive, read_dive
from tools.report.elsewhere import Elsewhere, elsewhere
from tools.report.losses import losses
from tools.report.report import Extras, Report, encode, make_report, report_on
from tools.report.summary import lined_up, summary
from tools.report.troubles import counted, ending, processes
from tools.report.unrecorded import unrecorded

__all__ = [
    "Adding",
    "Elsewhere",
    "Extras",
    "GatheredDive",
    "Passing",
    "RecordedDive",
    "Report",
    "counted",
    "elsewhere",
    "encode",
    "ending",
    "lined_up",
    "losses",
    "make_report",
    "processes",
    "read_dive",
    "report_on",
    "summary",
    "unrecorded",
]
