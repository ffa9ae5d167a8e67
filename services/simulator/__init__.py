"""A vehicle that is not there: physics, sensors and thrusters, said as a real driver would."""
