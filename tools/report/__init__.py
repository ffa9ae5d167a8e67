"""What a dive was like, in figures: `report.json`, and the summary a pilot reads."""

from tools.report.dive import Dive, read_dive
from tools.report.report import Extras, Report, encode, make_report, report_on
from tools.report.summary import summary

__all__ = [
    "Dive",
    "Extras",
    "Report",
    "encode",
    "make_report",
    "read_dive",
    "report_on",
    "summary",
]
