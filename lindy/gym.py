"""Environments for gymnasium: the agent is the controller of a vehicle that follows a pilot.

Sensors, estimation, reference, thrusters and water are those of `lindy sweep --fast`, in arrays: a
hundred vehicles cost little more than one. The agent gets what the estimate and the reference say,
and commands the heave force and the yaw moment; surge and sway are the pilot's.

Needs the extra `gym`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from services.control.core import YAW
from services.marine.vehicle import wrench_per_newton
from services.runtime.config.errors import LindyError
from tools.sweep.axes import Combination
from tools.sweep.fast.allocation import LaneAllocation
from tools.sweep.fast.batch import settings_of
from tools.sweep.fast.coverage import STACK, require_covered
from tools.sweep.fast.dives import Dives, DiveSettings, LaneState
from tools.sweep.fast.reference import LaneReference
from tools.sweep.fast.timeline import DiveTimes

Array = NDArray[np.float32]
Vector = NDArray[np.float64]
HEAVE = 2
OBSERVATION = (
    "depth error",  # [m] reference minus estimate
    "depth rate error",  # [m/s]
    "depth acceleration",  # [m/s²] of the reference
    "depth rate",  # [m/s] estimated
    "heading error",  # [rad]
    "yaw rate error",  # [rad/s]
    "yaw acceleration",  # [rad/s²] of the reference
    "yaw rate",  # [rad/s] estimated
)
METRE, RADIAN = 0.1, 0.1  # [m, rad] errors that cost 1 per second
EFFORT = 0.01  # per second, of full force or moment
PERIOD_S = 0.01


class FollowVectorEnv(VectorEnv[Array, Array, Vector]):
    """Vehicles of one kind, each with its own noise, which follow one pilot.

    Observation: float32, shape (num_envs, 8), as in `OBSERVATION`. Action: float32, shape
    (num_envs, 2), heave force (+ down) and yaw moment (+ clockwise) as shares of `most`, -1 to 1;
    beyond is limited, NaN is refused.
    Reward: minus the squared errors of depth and heading, in units of 10 cm and 0.1 rad, and a
    little for the effort, per second. A step is 10 ms. All vehicles end together, with the pilot's
    script (truncated); one that is lost, upside down or too deep, has ended (terminated).
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.DISABLED}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        *,
        vehicle: str = "pioneer",
        link: str = "tether",
        pilot: str = "script:first_dive",
        settings: Sequence[str] = (),
        seconds: float | None = None,
    ) -> None:
        """
        Args:
            settings: key.path=value, as of `lindy sweep --fast --set`.
            seconds: [s] after arming; None: to the script's end.

        Raises:
            LindyError: a mistake in a file or a setting, or the arrays do not know it.
        """
        if type(num_envs) is not int or num_envs < 1:
            raise LindyError(f"num_envs is {num_envs!r}, expected a whole number from 1")
        if seconds is not None and not 0.0 < seconds < np.inf:
            raise LindyError(f"seconds is {seconds}, expected a number above 0")
        wanted = Combination(vehicle, link, pilot, tuple(settings))
        self._settings: DiveSettings = settings_of(wanted, seconds)
        keys = [each.partition("=")[0] for each in settings]
        require_covered(self._settings, STACK, keys, link)
        self.num_envs = num_envs
        self.single_observation_space = Box(-np.inf, np.inf, (len(OBSERVATION),), np.float32)
        self.single_action_space = Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        hull = self._settings.vehicle
        turning = sum(
            abs(wrench_per_newton(t)[YAW]) * min(map(abs, t.limits)) for t in hull.thruster
        )
        self.most = np.array([min(hull.vertical_thrust), turning])  # [N, N m] of an action of 1
        self._episode = 0
        self._dives: Dives | None = None

    def reset(
        self,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002
    ) -> tuple[Array, dict[str, Any]]:
        """Seeds of the vehicles: `seed`, `seed` + 1 …; None: those after the last ones."""
        first = self._episode * self.num_envs if seed is None else seed
        self._episode = first // self.num_envs + 1
        count = self.num_envs
        with np.errstate(all="ignore"):
            self._dives = dives = Dives(self._settings, range(first, first + count))
            times = dives.calibrated(lambda _: True)
            assert times is not None
            self._times: DiveTimes = times
            control, hull = self._settings.control, self._settings.vehicle
            self._allocation = LaneAllocation(hull, control.allocation, count)
            self._look()
            while not self._armed:
                dives.drive(np.zeros((len(hull.thruster), count)))
                dives.move()
                self._look()
        return self._observation(), {}

    def step(self, actions: Array) -> tuple[Array, Vector, Any, Any, dict[str, Any]]:
        _ = self._begun
        given = np.asarray(actions, np.float64)
        if given.shape != self.action_space.shape or np.any(np.isnan(given)):
            raise LindyError(
                f"actions of shape {given.shape}, {np.count_nonzero(np.isnan(given))} of them not "
                f"a number; expected {self.action_space.shape}, numbers"
            )
        shares = np.clip(given, -1.0, 1.0)
        wrench = np.zeros((6, self.num_envs))
        wrench[0], wrench[1] = self._reference.surge_force, self._reference.sway_force
        wrench[HEAVE], wrench[YAW] = (shares * self.most).T
        return self._stepped(lambda: self._allocation.allocate_all(wrench).thrust, shares)

    def step_lindy(self) -> tuple[Array, Vector, Any, Any, dict[str, Any]]:
        """As `step`, with what Lindy's own control commands."""
        done = self._begun.controlled(self._reference, self._state)
        shares = done.achieved[[HEAVE, YAW]].T / self.most
        return self._stepped(lambda: done.thrust, shares)

    def _stepped(
        self, thrust: Callable[[], Vector], shares: Vector
    ) -> tuple[Array, Vector, Any, Any, dict[str, Any]]:
        dives = self._begun
        with np.errstate(all="ignore"):
            dives.drive(thrust())
            dives.move()
            self._look()
            lost = dives.lost()
        seen = self._observation()
        cost = (seen[:, 0] / METRE) ** 2 + (seen[:, 4] / RADIAN) ** 2
        reward = -PERIOD_S * (cost.astype(np.float64) + EFFORT * np.sum(shares**2, axis=1))
        ended = np.full(self.num_envs, not self._armed or dives.over(self._times))
        return seen, reward, lost, ended, {}

    @property
    def _begun(self) -> Dives:
        if self._dives is None:
            raise LindyError("reset() comes before the first step()")
        return self._dives

    def _look(self) -> None:
        self._state: LaneState
        self._reference: LaneReference
        self._state, self._reference, self._armed = self._begun.wanted(self._times)

    def _observation(self) -> Array:
        r, s = self._reference, self._state
        rows = (
            r.depth.position - s.depth, r.depth.velocity - s.rate, r.depth.acceleration, s.rate,
            r.heading.position - s.heading, r.heading.velocity - s.yaw_rate,
            r.heading.acceleration, s.yaw_rate,
        )  # fmt: skip
        return np.nan_to_num(np.array(np.broadcast_arrays(*rows), np.float32).T)


class FollowEnv(gymnasium.Env[Array, Array]):
    """One vehicle, as `FollowVectorEnv`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, **choices: Any) -> None:
        """`choices`: as of `FollowVectorEnv`."""
        self._lanes = FollowVectorEnv(1, **choices)
        self.observation_space = self._lanes.single_observation_space
        self.action_space = self._lanes.single_action_space

    def reset(
        self,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002
    ) -> tuple[Array, dict[str, Any]]:
        super().reset(seed=seed)
        seen, info = self._lanes.reset(seed=seed)
        return seen[0], info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        seen, reward, lost, ended, info = self._lanes.step(np.asarray(action)[None])
        return seen[0], float(reward[0]), bool(lost[0]), bool(ended[0]), info
