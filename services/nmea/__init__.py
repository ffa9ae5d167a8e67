"""A receiver of GNSS on the vehicle, by NMEA 0183: where it is while its antenna is in the air."""
