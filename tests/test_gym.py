"""The environment for gymnasium: the dive of a fast sweep, and what an agent makes of it."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra gym is not installed")

from gymnasium.utils.env_checker import check_env

from lindy.gym import METRE, OBSERVATION, RADIAN, Array, FollowEnv, FollowVectorEnv
from services.runtime.config.errors import LindyError
from tools.sweep.axes import Combination
from tools.sweep.fast.batch import settings_of
from tools.sweep.fast.dives import fly

SECONDS = 10.0


def pd(seen: Array) -> Array:
    """Proportional and derivative, for the Pioneer."""
    shares = (60.0 * seen[:, 0] + 65.0 * seen[:, 1], 8.0 * seen[:, 4] + 3.0 * seen[:, 5])
    return np.array(shares, np.float32).T / np.array([35.0, 7.7], np.float32)


@pytest.mark.filterwarnings("ignore:.*A Box observation space:UserWarning")
def test_gymnasium_accepts_it() -> None:
    check_env(FollowEnv(seconds=0.5), skip_render_check=True)


def cost(env: FollowVectorEnv, how: str) -> tuple[float, float]:
    """[-] Sum of rewards, and rms of the depth error [m], over all vehicles."""
    seen, _ = env.reset(seed=3)
    total, errors = 0.0, list[float]()
    while True:
        if how == "lindy":
            seen, reward, _, ended, _ = env.step_lindy()
        else:
            still = np.zeros((env.num_envs, 2), np.float32)
            seen, reward, _, ended, _ = env.step(pd(seen) if how == "pd" else still)
        total += float(reward.sum())
        errors.append(float(np.mean(seen[:, 0] ** 2)))
        if ended.all():
            return total, float(np.sqrt(np.mean(errors)))


@pytest.mark.slow
def test_lindys_control_is_that_of_a_sweep_and_better_than_none() -> None:
    env = FollowVectorEnv(3, seconds=SECONDS)
    lindy, error = cost(env, "lindy")
    tracks = fly(settings_of(Combination("pioneer", "tether", "script:first_dive", ()), SECONDS),
                 [3, 4, 5])  # fmt: skip
    assert tracks is not None
    swept = [tracks.figures(lane).depth_error_rms_m or 0.0 for lane in range(3)]
    # This one is of the estimate, that of the sweep of the truth.
    assert error == pytest.approx(np.sqrt(np.mean(np.square(swept))), rel=0.4)
    assert lindy > cost(env, "pd")[0] > cost(env, "none")[0]


def test_an_episode_is_repeated_by_its_seed() -> None:
    env = FollowVectorEnv(2, seconds=0.2)
    first = [env.reset(seed=5)[0], env.step(np.ones((2, 2), np.float32))[0]]
    assert not np.array_equal(first[0], env.reset()[0])  # the next seeds
    again = [env.reset(seed=5)[0], env.step(np.full((2, 2), np.inf, np.float32))[0]]
    np.testing.assert_array_equal(first, again)  # an infinite action is one of 1
    assert first[0].shape == (2, len(OBSERVATION))
    assert METRE == RADIAN


@pytest.mark.parametrize(
    ("choices", "why"),
    [
        ({"num_envs": 0}, "num_envs is 0"),
        ({"num_envs": "x"}, "num_envs is 'x'"),
        ({"seconds": -1.0}, "seconds is -1"),
        ({"seconds": float("nan")}, "seconds is nan"),
        ({"settings": ["reference.place.jerk=2"]}, "--fast"),
        ({"vehicle": "no_such"}, "no_such"),
    ],
)
def test_what_it_cannot_do_is_one_sentence(choices: dict[str, object], why: str) -> None:
    with pytest.raises(LindyError, match=why):
        FollowVectorEnv(**choices)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("actions", [np.full((2, 2), np.nan), np.zeros((3, 2)), np.zeros(2)])
def test_an_action_that_is_none_is_one_sentence(actions: Array) -> None:
    env = FollowVectorEnv(2, seconds=0.2)
    env.reset(seed=1)
    with pytest.raises(LindyError, match=r"expected \(2, 2\), numbers"):
        env.step(actions)


def test_a_step_before_a_reset_is_one_sentence() -> None:
    with pytest.raises(LindyError, match="reset"):
        FollowVectorEnv(1).step(np.zeros((1, 2), np.float32))
