"""The report of a dive: `report.json`, and the summary that a pilot reads."""

from tools.analysis.dive import GatheredDive, RecordedDive, read_dive
from tools.analysis.losses import losses
from tools.report.report import Extras, Report, encode, make_report, report_on
from tools.report.summary import Elsewhere, elsewhere, lined_up, restarted, summary, unrecorded
from tools.report.troubles import counted, ending, processes

__all__ = [
    "Elsewhere",
    "Extras",
    "GatheredDive",
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
    "restarted",
    "summary",
    "unrecorded",
]
