"""A simulated vehicle: physics, sensors and thrusters, with the messages of a real driver."""
