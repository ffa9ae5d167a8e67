"""`lindy calibrate`: the errors of the sensors, found from how they read in known positions."""
