"""`lindy identify`: a vehicle's inertia, drag, buoyancy and thruster lag from a dive."""
