"""Many simulated dives on all cores: axes and their product, one row of figures per dive, rows that
survive an interruption, tables and a picture of them."""
