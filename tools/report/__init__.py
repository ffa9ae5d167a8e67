"""The report of a dive: `report.json`, and the summary that a pilot reads."""
