"""Guidance as a `Reference` message: every axis at one instant."""

from messages.pilot import PilotCommand
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Ns
from services.reference.guidance.guidance import Guidance
from services.reference.trajectory.minimum_jerk import Ramp, Sample


def reference_of(
    guidance: Guidance,
    state: VehicleState | None,
    command: PilotCommand | None,
    now: Ns,
    *,
    armed_ns: Ns | None,
    epoch: int,
) -> Reference:
    """All axes now, with the stamps of the state and pilot command behind them. `armed_ns` None:
    disarmed."""
    axes, held, t = guidance.axes, guidance.held, guidance.t
    depth, heading, place, pace = _motions(guidance)
    surge_force, sway_force = axes.force.at(t)
    return Reference(
        stamp_ns=now,
        sensor_ns=None if state is None else state.sensor_ns,
        pilot_ns=None if command is None else command.stamp_ns,
        epoch=epoch,
        armed=armed_ns is not None,
        armed_ns=armed_ns,
        depth=depth,
        heading=heading,
        surge_force=surge_force.velocity,
        sway_force=sway_force.velocity,
        heave_force=None if held.depth else axes.heave_force.at(t).velocity,
        yaw_moment=None if held.heading else axes.yaw_moment.at(t).velocity,
        surge=pace if place is None else None,
        north=None if place is None else _moving(place[0]),
        east=None if place is None else _moving(place[1]),
        tilt=_ramped(axes.tilt, t),
    )


def _motions(
    guidance: Guidance,
) -> tuple[Motion, Motion, tuple[Sample, Sample] | None, Motion | None]:
    """Depth, heading, position and speed along the path, from the path or from the axes."""
    axes, held, t = guidance.axes, guidance.held, guidance.t
    depth = _ramped(axes.heave, t) if held.depth else _followed(axes.heave, t)
    heading = _ramped(axes.yaw, t) if held.heading else _followed(axes.yaw, t)
    if (following := guidance.manoeuvre.following) is None:
        pace = _ramped(axes.pace, t)
        place = axes.place.now if axes.place.held else None
        return depth, heading, place, pace if pace.velocity != 0.0 else None
    here = following.point(t)
    if following.has_depth:
        depth = _moving(following.depth(here))
    pace = _moving(following.along(t))
    return depth, _moving(following.heading(here)), following.place(here), pace


def _ramped(ramp: Ramp, t: float) -> Motion:
    return Motion(*ramp.at(t), jerk_limit=ramp.in_force.jerk)


def _followed(ramp: Ramp, t: float) -> Motion:
    """Of an axis that follows the vehicle: its jerk is unknown."""
    return _moving(ramp.at(t)._replace(jerk=0.0))


def _moving(sample: Sample) -> Motion:
    """A motion without a jerk limit of its own."""
    return Motion(*sample)
