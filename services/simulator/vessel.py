"""The vehicle in the water: six degrees of freedom, thrusters with lag, current, surroundings.

The equations of motion (equations.py) are integrated by the explicit midpoint rule, of second
order, at 200 Hz, with quaternion kinematics; the thrusters' lag is solved exactly. Plain floats
throughout: at this size that is several times faster than NumPy.
"""

from collections.abc import Sequence

from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import attitude_rate, down_in_body, normalised, to_body, to_world
from services.marine.rigid_body import system_inertia
from services.marine.summation import plain_sum
from services.marine.vehicle import Vehicle
from services.simulator.current import Current
from services.simulator.equations import equations_of_motion
from services.simulator.faults import Faults
from services.simulator.hull import in_the_water, shifted_centres
from services.simulator.propulsion import SimulatedThrusters
from services.simulator.settings import Settings
from services.simulator.surroundings import Surroundings
from services.simulator.waves import water_at

# Position NED [m], attitude q_NB (w, x, y, z), velocity over the ground FRD [m/s], angular rate
# FRD [rad/s].
State = tuple[float, ...]  # 13 numbers

STEP = 0.005  # [s] longest step in open water
STEP_AT_BARRIER = 0.001  # [s] longest step near floor or walls, because they are stiff
ABSURD = 1e6  # [m/s, rad/s] a larger velocity means divergence


class Vessel:
    """Advances in time by `advance`; `drive` and `set_faults` set its inputs."""

    def __init__(
        self,
        vehicle: Vehicle,
        place: Settings,
        state: State,
        thrust: Sequence[float],
        seed: int = 0,
    ) -> None:
        """
        Args:
            vehicle: of the vehicle file; what `place.hull` says is different.
            thrust: [N] per thruster at the start.
            seed: [-] 0 or more, of the current.
        """
        hull = place.hull
        self.vehicle = vehicle = in_the_water(vehicle, hull)
        self.current: Vec3 = (0.0, 0.0, 0.0)  # [m/s] NED
        self._water = Current(place.current, seed) if place.current is not None else None
        self._waves = place.waves if place.waves and place.waves.moves_hull else None
        self._orbit: Vec3 | None = None  # [m/s] NED, of the water in the wave; None: no such wave
        self._rise = 0.0  # [m] of the surface
        self.elapsed = 0.0  # [s]
        self._shifted = shifted_centres(vehicle, hull)
        self._acceleration = equations_of_motion(vehicle, place.wake_share)
        self._propulsion = SimulatedThrusters(vehicle, thrust, hull.thrust_scale if hull else 1.0)
        self._around = Surroundings(place, vehicle.size, system_inertia(vehicle)[2])
        self._always_wet_below = max(plain_sum(map(abs, t.position)) for t in vehicle.thruster)
        x, y, z, qw, qx, qy, qz, u, v, w, p, q, r = state
        self.position: Vec3 = (x, y, z)  # [m] NED
        self.attitude = normalised((qw, qx, qy, qz))  # q_NB
        self.through_water: Vec6 = (u, v, w, p, q, r)  # [m/s, rad/s] FRD
        self._ride()
        if self._orbit is not None:
            a, b, c = to_body(self.attitude, self._orbit)
            self.through_water = (u - a, v - b, w - c, p, q, r)
        self._flow(0.0)
        self._look_around()

    def sag(self, share: float) -> None:
        """Thrust from now on is this share [-] of that with a full battery."""
        self._propulsion.sag = share

    def drive(self, thrust: Sequence[float]) -> None:
        """Command this thrust [N] from now on."""
        self._propulsion.drive(thrust)

    def set_faults(self, faults: Faults) -> None:
        """Set the faults by thruster name; all others work."""
        self._propulsion.set_faults(faults)

    def advance(self, seconds: float) -> None:
        """Advance by `seconds`.

        Raises:
            FloatingPointError: the motion has diverged; the vehicle's parameters are wrong.
        """
        steps = int(seconds / STEP - 1e-9) + 1
        for _ in range(steps):
            self._go(seconds / steps)
        if not plain_sum(map(abs, self.through_water)) < ABSURD:  # NaN is not smaller than anything
            raise FloatingPointError(f"the vehicle's motion has diverged: {self.state}")

    # Outputs.

    @property
    def state(self) -> State:
        return *self.position, *self.attitude, *self.velocity

    @property
    def velocity(self) -> Vec6:
        """[m/s, rad/s] FRD over the ground."""
        return self._over_ground(self.attitude, self.through_water)

    @property
    def settles_at(self) -> list[float]:
        """[N] per thruster, final value for the present command."""
        return self._propulsion.settles_at

    @property
    def thrust(self) -> list[float]:
        """[N] per thruster now, as if all were in water."""
        return self._propulsion.thrust

    @property
    def produced(self) -> list[float]:
        """[N] per thruster now; those out of the water produce none."""
        return self._propulsion.produced

    @property
    def acceleration(self) -> Vec6:
        """[m/s², rad/s²] dνᵣ/dt now, of `through_water`, as seen in the turning body frame, and in
        a wave the water's own acceleration."""
        if self._waves is None:
            return self._nu_dot
        carried = water_at(self._waves, self.elapsed, self.position).acceleration
        return add(self._nu_dot, (*to_body(self.attitude, carried), 0.0, 0.0, 0.0))

    @property
    def effort(self) -> float:
        """[-] Mean of |thrust| over its limit."""
        pairs = zip(self.produced, self.vehicle.thruster, strict=True)
        shares = [newtons / t.limits[newtons >= 0.0] for newtons, t in pairs]
        return plain_sum(map(abs, shares)) / len(shares)

    @property
    def tether_pull(self) -> Vec3:
        """[N] NED."""
        return self._around.tether_pull(self.position[2], self.attitude, self.through_water)

    @property
    def on_floor(self) -> bool:
        return self._around.floor_felt(self.position, self.attitude)

    # Integration.

    def _go(self, seconds: float) -> None:
        """One step, divided into shorter ones near a barrier."""
        parts = int(seconds / STEP_AT_BARRIER - 1e-9) + 1 if self._near else 1
        for _ in range(parts):
            self._step(seconds / parts)

    def _step(self, h: float) -> None:
        """The explicit midpoint rule: the slope of the step [s] is that in its middle."""
        half = h / 2
        x, y, z = self.position
        qw, qx, qy, qz = self.attitude
        u, v, w, p, q, r = self.through_water

        # To the middle, by the slope at the beginning.
        du, dv, dw, dp, dq, dr = self._nu_dot
        nu = (u + half * du, v + half * dv, w + half * dw,
              p + half * dp, q + half * dq, r + half * dr)  # fmt: skip
        ew, ex, ey, ez = attitude_rate(self.attitude, (p, q, r))
        q_NB = (qw + half * ew, qx + half * ex, qy + half * ey, qz + half * ez)
        a, b, c = down_in_body(self.attitude)
        middle = (x, y, z + half * (a * u + b * v + c * w))
        if self._near:
            north, east, _ = to_world(
                self.attitude, self._over_ground(self.attitude, self.through_water)[:3]
            )
            middle = (x + half * north, y + half * east, middle[2])

        # Across the whole step, by the slope in the middle.
        du, dv, dw, dp, dq, dr = self._slope(half, middle, q_NB, nu)
        ew, ex, ey, ez = attitude_rate(q_NB, (nu[3], nu[4], nu[5]))
        north, east, down = to_world(q_NB, (nu[0], nu[1], nu[2]))
        set_north, set_east, _ = self.current
        self.position = (x + h * (north + set_north), y + h * (east + set_east), z + h * down)
        if self._orbit is not None:
            self.position = _along(self.position, self._orbit, h)
        self.attitude = normalised((qw + h * ew, qx + h * ex, qy + h * ey, qz + h * ez))
        self.through_water = (u + h * du, v + h * dv, w + h * dw,
                              p + h * dp, q + h * dq, r + h * dr)  # fmt: skip

        self._propulsion.pass_time(h)
        self._flow(h)
        self.elapsed += h
        self._ride()
        self._look_around()

    def _slope(self, ahead: float, position: Vec3, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """dνᵣ/dt with the thrust `ahead` [s] from now."""
        tau = self._propulsion.wrench(ahead)
        if self._near:
            over_ground = self._over_ground(q_NB, nu)
            for push in self._around.push(self._near, position, q_NB, over_ground):
                tau = add(tau, push)
        if self._around.tether is not None:
            tau = add(tau, self._around.pull(position[2], q_NB, nu))
        depth = position[2] + self._rise
        if self._shifted is not None:
            tau = add(tau, self._shifted.moment(depth, q_NB))
        return self._acceleration(depth, q_NB, nu, tau)

    def _look_around(self) -> None:
        """Update barriers, dry thrusters and acceleration for the new position."""
        self._near = self._around.near(self.position)
        if self.position[2] < self._always_wet_below:
            self._propulsion.leave_water(self._thrusters_in_air())
        self._nu_dot = self._slope(0.0, self.position, self.attitude, self.through_water)

    def _flow(self, seconds: float) -> None:
        """Update the current; a change does not alter the velocity over the ground."""
        if self._water is None:
            return
        current = self._water.at(self.elapsed + seconds)
        if current != self.current:
            (a, b, _), (c, d, _) = self.current, current
            change = to_body(self.attitude, (c - a, d - b, 0.0))
            self.through_water = add(
                self.through_water, (-change[0], -change[1], -change[2], 0.0, 0.0, 0.0)
            )
            self.current = current

    def _ride(self) -> None:
        """Take along the water's motion in a wave. A body as heavy as its water, and small beside
        the wave, moves as that water would: its pressure gradient accelerates both alike (Faltinsen
        1990, ch. 3, Froude-Kriloff and added-mass force). So νᵣ stays as it is."""
        if self._waves is not None:
            water = water_at(self._waves, self.elapsed, self.position)
            self._orbit, self._rise = water.velocity, water.rise

    def _over_ground(self, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """ν = νᵣ + ν_c (Fossen 2011, §8.3)."""
        if self._orbit is not None:
            nu = add(nu, (*to_body(q_NB, self._orbit), 0.0, 0.0, 0.0))
        if self._water is None:
            return nu
        return add(nu, (*to_body(q_NB, self.current), 0.0, 0.0, 0.0))

    def _thrusters_in_air(self) -> list[int]:
        a, b, c = down_in_body(self.attitude)
        depth = self.position[2] + self._rise
        places = [thruster.position for thruster in self.vehicle.thruster]
        return [i for i, (x, y, z) in enumerate(places) if depth + a * x + b * y + c * z < 0]


def add(a: Vec6, b: Vec6) -> Vec6:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


def _along(position: Vec3, velocity: Vec3, seconds: float) -> Vec3:
    (x, y, z), (u, v, w) = position, velocity
    return x + seconds * u, y + seconds * v, z + seconds * w
