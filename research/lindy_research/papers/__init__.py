"""Figures and numeric claims of the two papers, drawn and computed again with Lindy's own code."""
