"""The drone as a submarine on MAVLink 2, for ground stations: QGroundControl, MAVProxy, Cockpit."""
