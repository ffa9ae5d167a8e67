"""To fly a reference law of your own: the lease, the failsafes, arming and every other motion stay
Lindy's. docs/library.md

`wire(node, stack, law)` is what a module named for `[services.reference]` calls in its own `wire`;
`Settings` is the table [reference] of the vehicle file."""

from services.reference.service import wire
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Sample
from services.reference.trajectory.own_law import AxisPlan, Law

__all__ = ["AxisPlan", "Law", "Sample", "Settings", "wire"]
