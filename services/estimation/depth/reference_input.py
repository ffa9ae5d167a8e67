"""What the reference asks of the vertical motion, as an input of the depth observer "reference".

Only what the vehicle is really being told to do is an input: a reference that is disarmed, stale
or merely follows the vehicle (heave as a force) says nothing about the motion to come.

A vehicle that is blocked, or drifts, does not make the motion that is asked for, and this observer
cannot feel that it does not. It believes the asked-for rate until the pressure has talked it out of
it. With the least `motion_noise` that is allowed that is soon: for a step of 0.5 m/s against an
obstacle and a sensor of σ 5 cm, depth and rate stay within four of the standard deviations stated,
and the rate is right again within a second of the ramp's end. A smaller `motion_noise` is refused:
the rate would then be the reference's and no longer the vehicle's, and a control loop that hears
its own wish has no damping. Even so, in simulated dives with σ 5 cm the rate is wrong by 0.13 m/s
rms, against 0.006 with the accelerometer, and a vehicle that should rest moves with 0.1 m/s. This
observer is for a vehicle without a working accelerometer along down, or with a fine depth sensor.
The accelerometer feels the obstacle at once; it is the default.
"""

from messages.reference import Reference


def asked_acceleration(reference: Reference | None) -> float | None:
    """[m/s²] along down; None: nothing is known to be asked for."""
    if reference is None or not reference.armed or reference.heave_force is not None:
        return None
    return reference.depth.acceleration
