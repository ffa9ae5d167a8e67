"""What the thrusters used."""

import msgspec
import numpy as np

from messages import topics
from tools.report.dive import Dive


class Energy(msgspec.Struct, frozen=True):
    thrust_squared_n2s: float  # [N² s] sum of thrust² over all thrusters and time
    wh: float  # [Wh] electrical, of the thrusters alone


def energy(dive: Dive) -> Energy:
    """Integrals over the whole recording by the trapezium rule, from `Actuation`."""
    actuation = dive[topics.ACTUATION]
    seconds = (actuation["stamp"] - actuation["stamp"][:1]) / 1e9
    return Energy(
        thrust_squared_n2s=float(np.trapezoid(actuation["thrust_squared"], seconds)),
        wh=float(np.trapezoid(actuation["power"], seconds)) / 3600.0,
    )
