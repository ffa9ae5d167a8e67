"""Control gains for a vehicle: linear-quadratic design over the sampled loop."""
