"""Reference generators. Pure: the time is an argument.

`Ramp`, `VectorRamp` and `PositionMove` are what flies; `Ramp.take` stops any other motion. The
others are there to compare with: the usual filters, the rule of Andrén 2023, the reference model of
Fernandes et al. 2015."""

from services.reference.trajectory.minimum_jerk import (
    Limits,
    PositionMove,
    Ramp,
    Sample,
    Segment,
    solve,
)
from services.reference.trajectory.minimum_jerk import pair as position_move
from services.reference.trajectory.vector import VectorRamp
from tools.generators import thesis_rule
from tools.generators.baselines import (
    BaselineReference,
    Direct,
    Filter,
    PlannedBaseline,
    minimum_time,
)
from tools.generators.fernandes import MotionRequest, ReferenceModel, plan

__all__ = [
    "BaselineReference",
    "Direct",
    "Filter",
    "Limits",
    "MotionRequest",
    "PlannedBaseline",
    "PositionMove",
    "Ramp",
    "ReferenceModel",
    "Sample",
    "Segment",
    "VectorRamp",
    "minimum_time",
    "plan",
    "position_move",
    "solve",
    "thesis_rule",
]
