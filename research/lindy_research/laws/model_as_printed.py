"""The reference model with the times T1 and T4 as Fernandes et al. 2015 print them.

For comparison with the paper's figures and tables only: the printed times leave small steps that
`reference_model.plan` does not have.
"""

from lindy.api.references import MotionRequest, ReferenceModel
from tools.generators.fernandes import (
    SpeedChange,
    assembled,
    cruise_speed,
    model,
    speed_change,
    speed_changes,
)


def basic_as_printed(request: MotionRequest) -> ReferenceModel:
    """T1 = ξ_a τ11 (39) and T4 = ξ_d τ31 (42) beside (27)-(30) and (41): P5 misses the length.

    Raises:
        ValueError: as `plan`, or the request is not from rest to rest.
    """
    request.check()
    if request.initial or request.final:
        raise ValueError("the basic version goes from rest to rest, expected initial and final 0")
    up, down = speed_changes(request)
    corrected = model(request, up, down, cruise_speed(request, up, down))
    v_m = corrected.v_m
    speeding_up, slowing_down = _as_printed(up).phases(0.0, v_m), _as_printed(down).phases(v_m, 0.0)
    phases = (*speeding_up, corrected.phases[2], *slowing_down)
    return assembled(request, corrected.v_c, phases)


def advanced_as_printed(request: MotionRequest) -> ReferenceModel:
    """T1 and T4 "defined similarly to (39)-(42)" within (65)-(79): ends at the length.

    Raises:
        ValueError: as `plan`.
    """
    request.check()
    up, down = (_as_printed(change) for change in speed_changes(request))
    return model(request, up, down, cruise_speed(request, up, down))


def _as_printed(change: SpeedChange) -> SpeedChange:
    return speed_change(change.rate, change.share, change.xi, change.theta_0, change.xi)
