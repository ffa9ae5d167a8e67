"""The horizontal velocity that the thrust gives the vehicle, for the depth filter.

The filter learns the attitude's tilt error from the horizontal velocity, because the error makes
the integrated acceleration drift. Few vehicles measure that velocity. The thrust, as the driver
reports it, and the drag of the vehicle file predict it, through the water.

The prediction is as wrong as the hull is unlike its file, in proportion to the speed, and as wrong
as the tether pulls. Without reports of thrust it fades to zero within a few seconds, and its error
grows to that of a vehicle of which nothing is known.
"""

from math import hypot

from messages import events, topics
from messages.events import Event
from messages.units import Vec3, Vec6
from messages.vehicle import Actuation
from services.estimation.attitude_axes import MOVING_STD, AttitudeAxes
from services.marine.hydrodynamics import Translation, flow
from services.marine.vehicle import Vehicle, limited, total_wrench, wrench_per_newton

STILL_STD = 0.2  # [m/s] of the prediction at rest; with 0.1 a wrong attitude was believed longer
SHARE = 0.5  # [-] of the predicted speed: thrust -40 % or damping ×2, and a wrong attitude
STEEPEST = 0.5  # [-] of the hull's down axis that is vertical; with less, nothing is predicted
TRUST_TIME = 2.0  # [s] time constant with which the prediction is trusted, or no longer
PATIENCE = 0.5  # [s] an older report of thrust is not used
BEYOND = 1e-6  # [N] more than a limit; less is rounding
FASTEST = 5.0  # [m/s] along one axis; keeps an absurd report from becoming infinity
NONE: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class ThrustSpeed:
    def __init__(self, vehicle: Vehicle, wake_share: float, *, at_rest: bool) -> None:
        """
        Args:
            vehicle: of the vehicle file.
            wake_share: [-] of the Munk moment that the wake cancels, see `wake_fins`.
            at_rest: it begins with a vehicle at rest; otherwise its velocity is unknown.
        """
        self.surge = self.sway = 0.0  # [m/s] through the water
        # [m/s²] forward and starboard, that an accelerometer should measure beside gravity.
        self.felt = (0.0, 0.0)
        self._unknown = 0.0 if at_rest else 1.0  # [-] 0: prediction is trusted, 1: it is not used
        self._thrusters = vehicle.thruster
        self._columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]
        self._hull = Translation(vehicle, wake_share)
        self._thrust = NONE
        self._heard_ns: int | None = None  # [ns] stamp of the newest report
        self._silent = self._beyond = False

    def actuation(self, sample: Actuation) -> Event | None:
        """Thrust as reported; a report of another length is counted elsewhere. An event to tell,
        once when a thruster begins to report more than it has."""
        if len(sample.thrust) != len(self._columns):
            return None
        possible, beyond = list[float](), False
        for thruster, reported in zip(self._thrusters, sample.thrust, strict=True):
            newtons = limited(thruster, reported)
            beyond = beyond or abs(newtons - reported) > BEYOND
            possible.append(newtons)
        self._thrust, self._heard_ns = total_wrench(self._columns, possible), sample.stamp_ns
        before, self._beyond = self._beyond, beyond
        return events.CLAMPED(topics.ACTUATION.key) if beyond and not before else None

    def silence(self, now: int) -> Event | None:
        """An event to tell, once when the reports of thrust have stopped."""
        if self._heard_ns is None:
            self._heard_ns = now
        before, self._silent = self._silent, abs(now - self._heard_ns) * 1e-9 > PATIENCE
        return events.SILENT(topics.ACTUATION.key) if self._silent and not before else None

    def lost(self) -> None:
        """It was not stepped for a while: the velocity is unknown."""
        self.surge = self.sway = 0.0
        self.felt = (0.0, 0.0)
        self._unknown = 1.0

    def step(self, axes: AttitudeAxes, rate: Vec3, depth_rate: float, dt: float) -> AttitudeAxes:
        """Advance by `dt` [s]. Returns the axes with the velocity to be expected.

        Args:
            rate: [rad/s] of the body.
            depth_rate: [m/s].
        """
        axis = axes.down
        down = axes.forward[2], axes.starboard[2], axis[2]  # the world's in the body
        share, heave = dt / (TRUST_TIME + dt), 0.0
        if axis[2] > STEEPEST and not self._silent:
            self._unknown -= share * self._unknown
            nu = flow(self.surge, self.sway, depth_rate, down, rate)
            along, across, _ = self._hull.acceleration(nu, self._thrust)
            u, v, w, p, q, r = nu
            heave, trust = w, 1.0 - self._unknown
            self.felt = trust * (along + q * w - r * v), trust * (across + r * u - p * w)
            self.surge = max(-FASTEST, min(FASTEST, self.surge + along * dt))
            self.sway = max(-FASTEST, min(FASTEST, self.sway + across * dt))
        else:
            self.felt = (0.0, 0.0)
            self._unknown += share * (1.0 - self._unknown)
            self.surge -= share * self.surge
            self.sway -= share * self.sway

        trust, u, v = 1.0 - self._unknown, self.surge, self.sway
        (fn, fe, _), (sn, se, _), (dn, de, _) = axes.forward, axes.starboard, axis
        north = trust * (u * fn + v * sn + heave * dn)
        east = trust * (u * fe + v * se + heave * de)
        std = hypot(STILL_STD, SHARE * north, SHARE * east)
        std = min(MOVING_STD, trust * std + self._unknown * MOVING_STD)
        return axes._replace(velocity=(north, east), velocity_std=std)
