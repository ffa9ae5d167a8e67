"""The vehicle in the water: six degrees of freedom, thrusters with lag, surface and sea floor.

M ν̇ + C(ν)ν + D(ν)ν + g(η) = τ (Fossen 2011, eq. 6.1 to 6.3 without waves and current), with
quaternion kinematics, solved by the classic fourth-order Runge-Kutta method. The thrusters' lag is
solved exactly beside it. All in plain floats: at this size that is four times faster than NumPy.
"""

from collections.abc import Sequence

from services.marine.attitude import attitude_rate, down_in_body, normalised, to_world
from services.marine.hydrodynamics import damping, full_buoyancy, restoring, submerged_share
from services.marine.rigid_body import coriolis, system_inertia
from services.marine.thrusters import driven, lagged, limited, total_wrench, wrench_per_newton
from services.marine.vehicle import GRAVITY, Vec3, Vec6, Vehicle
from services.marine.wake import wake_fins, wake_lift
from services.simulator.sea_floor import SeaFloor

# Position NED [m], attitude q_NB (w, x, y, z), velocity FRD [m/s], angular rate FRD [rad/s].
State = tuple[float, ...]  # 13 numbers

STEP = 0.01  # [s] longest integration step; a tenth of it changes a dive by less than a millimetre
ABSURD = 1e6  # [m, m/s, rad/s] nothing we simulate gets there


class Vessel:
    """Moves in time by `advance`; everything else is reading."""

    def __init__(
        self,
        vehicle: Vehicle,
        floor_depth: float,
        wake_share: float,
        state: State,
        thrust: Sequence[float],
    ) -> None:
        """
        Args:
            floor_depth: [m].
            wake_share: [-] of the Munk moment that the wake takes back, see `wake_fins`.
            thrust: [N] per thruster at the beginning.
        """
        self.vehicle = vehicle
        self.wanted = [0.0] * len(vehicle.thruster)  # [N] what the thrusters settle at
        self._fins = wake_fins(vehicle, wake_share)
        self._M = system_inertia(vehicle)
        self._weight = vehicle.mass * GRAVITY
        self._full_buoyancy = full_buoyancy(vehicle)
        self._columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]
        self._always_wet_below = max(
            sum(abs(c) for c in thruster.position) for thruster in vehicle.thruster
        )
        self._floor = SeaFloor(floor_depth, vehicle.size, self._M[2])
        self._arrive(state, list(thrust))

    def drive(self, thrust: Sequence[float]) -> list[str]:
        """Ask the thrusters for this thrust [N] from now on; returns who is at its limit."""
        pairs = list(zip(self.vehicle.thruster, thrust, strict=True))
        self.wanted = [driven(thruster, command) for thruster, command in pairs]
        return [t.name for t, command in pairs if limited(t, command) != command]

    def advance(self, seconds: float) -> None:
        """Move on in time.

        Raises:
            FloatingPointError: the motion has become absurd; the vehicle's parameters are wrong.
        """
        steps = int(seconds / STEP - 1e-9) + 1
        for _ in range(steps):
            self._step(seconds / steps)
        if not sum(map(abs, self.state)) < ABSURD:  # NaN is not smaller than anything
            raise FloatingPointError(f"the vehicle's motion has diverged: {self.state}")

    @property
    def produced(self) -> list[float]:
        """[N] Thrust per thruster now; those out of the water produce none."""
        return self._in_water(self.thrust)

    @property
    def acceleration(self) -> Vec6:
        """[m/s², rad/s²] dν/dt now, as seen in the turning body frame."""
        _, _, _, _, _, _, _, a, b, c, d, e, f = self._rate
        return a, b, c, d, e, f

    @property
    def on_floor(self) -> bool:
        _, _, z, qw, qx, qy, qz, *_ = self.state
        return self._floor.touches(z, down_in_body((qw, qx, qy, qz)))

    def _step(self, seconds: float) -> None:
        half = seconds / 2
        thrust = self._thrust_after(seconds)
        tau_half = self._wrench(self._thrust_after(half))
        s, k1 = self.state, self._rate
        k2 = self._rates(_moved(s, k1, half), tau_half)
        k3 = self._rates(_moved(s, k2, half), tau_half)
        k4 = self._rates(_moved(s, k3, seconds), self._wrench(thrust))
        sixth = seconds / 6
        after = [
            x + sixth * (a + 2 * (b + c) + d)
            for x, a, b, c, d in zip(s, k1, k2, k3, k4, strict=True)
        ]
        self._arrive(after, thrust)

    def _arrive(self, state: Sequence[float], thrust: list[float]) -> None:
        """Be in this state, with what the next step and the sensors need to know about it."""
        x, y, z, qw, qx, qy, qz, *nu = state
        q_NB = normalised((qw, qx, qy, qz))
        self.state: State = (x, y, z, *q_NB, *nu)
        self.thrust = thrust  # [N] per thruster, as if in water
        self._dry: list[int] = []
        if z < self._always_wet_below:
            self._dry = self._thrusters_in_air(z, down_in_body(q_NB))
        self._rate = self._rates(self.state, self._wrench(thrust))

    def _rates(self, state: State, tau: Vec6) -> State:
        """Time derivative of the state under the thrusters' wrench."""
        _, _, z, qw, qx, qy, qz, u, v, w, p, q, r = state
        q_NB, nu, vehicle = (qw, qx, qy, qz), (u, v, w, p, q, r), self.vehicle
        down_B = down_in_body(q_NB)
        buoyancy = self._full_buoyancy * submerged_share(vehicle.size[2], z)
        cor = coriolis(self._M, nu)
        drag = damping(vehicle.linear_damping, vehicle.quadratic_damping, nu)
        g = restoring(self._weight, buoyancy, vehicle.metacentric_height, down_B)
        lift = wake_lift(self._fins, nu)
        push = self._floor.push(z, down_B, nu)
        acceleration = [
            (a + b + e - c - d - f) / m
            for m, a, b, e, c, d, f in zip(self._M, tau, push, lift, cor, drag, g, strict=True)
        ]
        return (
            *to_world(q_NB, (u, v, w)),
            *attitude_rate(q_NB, (p, q, r)),
            *acceleration,
        )

    def _thrust_after(self, seconds: float) -> list[float]:
        return [
            lagged(now, wanted, thruster.time_constant, seconds)
            for now, wanted, thruster in zip(
                self.thrust, self.wanted, self.vehicle.thruster, strict=True
            )
        ]

    def _wrench(self, thrust: list[float]) -> Vec6:
        return total_wrench(self._columns, self._in_water(thrust))

    def _in_water(self, thrust: list[float]) -> list[float]:
        if not self._dry:
            return thrust
        return [0.0 if i in self._dry else t for i, t in enumerate(thrust)]

    def _thrusters_in_air(self, depth: float, down_B: Vec3) -> list[int]:
        a, b, c = down_B
        places = [thruster.position for thruster in self.vehicle.thruster]
        return [i for i, (x, y, z) in enumerate(places) if depth + a * x + b * y + c * z < 0]


def _moved(state: State, rate: State, seconds: float) -> State:
    return tuple([x + seconds * dx for x, dx in zip(state, rate, strict=True)])
