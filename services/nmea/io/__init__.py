"""Sentences of NMEA 0183. The only place that knows pynmea2."""
