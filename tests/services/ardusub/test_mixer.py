"""The six axes give the wrench, within what every motor can give; frames by their facts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from services.ardusub.mixing import FRAMES, MixedSticks, Mixer, MotorCurves, RcChannel, senses
from services.control.allocation import Allocation
from services.control.laws import Settings as ControlSettings
from services.marine.vehicle import Vehicle, total_wrench, wrench_per_newton
from services.runtime.config.stack import Stack
from tests.support.ardusub_double.motors import axes_of, motor_pulses
from tests.support.ardusub_double.settings import defaults

STACK = Stack(vehicle="bluerov2_heavy")
VEHICLE = STACK.section("vehicle", Vehicle)
THRUSTERS = VEHICLE.thruster
COLUMNS = [wrench_per_newton(t) for t in THRUSTERS]
INVERSE = np.linalg.pinv(np.array(COLUMNS).T)
SCALE = np.array([30.0, 30.0, 40.0, 3.0, 3.0, 6.0])  # [N, N m]
CHANNELS = [RcChannel()] * 6
MIXER = Mixer(FRAMES[2], THRUSTERS, CHANNELS)
ALLOCATION = Allocation(VEHICLE, STACK.section("control", ControlSettings).allocation)
EDGE = 4 * max(t.dead_band for t in THRUSTERS)  # [N] what dead bands may leave of an axis
share = st.floats(-1.0, 1.0)
newtons = st.floats(-30.4, 30.4)
forces = st.tuples(*[newtons] * 8)


def thrust_for(shares: tuple[float, ...]) -> tuple[float, ...]:
    thrust = INVERSE @ (np.array(shares) * SCALE)
    return tuple((thrust / max(1.0, np.max(np.abs(thrust)) / 25.0)).tolist())


def wrench_of(mixed: MixedSticks) -> list[float]:
    """[N, N m] Of the motors."""
    return list(total_wrench(COLUMNS, mixed.thrust))


def motors_of(mixed: MixedSticks, version: str = "4.8") -> list[int]:
    """[µs] What the board makes of the sticks."""
    params = {**defaults(version), "FRAME_CONFIG": 2.0}
    return motor_pulses(axes_of(mixed.pulses, params, version), params)


@given(st.tuples(*[share] * 6))
def test_the_wrench_is_given_up_to_the_dead_bands(shares: tuple[float, ...]) -> None:
    thrust = thrust_for(shares)
    mixed = MIXER.mix(thrust)
    if not mixed.limited:
        wanted = np.array(total_wrench(COLUMNS, thrust))
        left = np.abs(np.array(wrench_of(mixed)) - wanted)
        assert np.all(left[:3] <= EDGE)


@given(forces)
def test_nothing_is_left_for_the_board_to_clip_or_scale(thrust: tuple[float, ...]) -> None:
    mixed = MIXER.mix(thrust)
    assert all(1100 <= pulse <= 1900 for pulse in mixed.pulses)
    axes = axes_of(mixed.pulses, {**defaults("4.8")}, "4.8")
    plain = [sum(f * a for f, a in zip(m, axes, strict=True)) for m in FRAMES[2].motors]
    for group in (plain[:4], plain[4:]):
        assert max(map(abs, group)) <= 1.0 + 4 * 0.5 / 400.0, "but for the rounding of pulses"


@given(forces)
@pytest.mark.parametrize("version", ["4.5", "4.8"])
def test_what_is_expected_is_what_the_board_does(version: str, thrust: tuple[float, ...]) -> None:
    if version == "4.5":
        channels = [*CHANNELS]
        channels[2] = RcChannel(1100.0, 1100.0, 1900.0)
        mixed = Mixer(FRAMES[2], THRUSTERS, channels).mix(thrust)
    else:
        mixed = MIXER.mix(thrust)
    turned = np.array(senses(FRAMES[2], THRUSTERS))
    outputs = (np.array(motors_of(mixed, version)) - 1500) / 400.0
    thrust_there = MotorCurves(THRUSTERS, turned).thrust(outputs) * turned
    assert np.allclose(thrust_there, mixed.thrust, atol=0.8)


@given(st.tuples(*[st.floats(-5.0, 5.0)] * 6))
def test_control_asks_for_hardly_more_than_the_board_can_give(shares: tuple[float, ...]) -> None:
    """Whatever the pilot wants, what control believes it achieved is what comes, so that no
    integrator winds up against a limit that only the board knows."""
    x, y, z, k, m, n = (np.array(shares) * SCALE).tolist()
    done = ALLOCATION.allocate((x, y, z, k, m, n))
    believed = np.array(done.achieved) / SCALE
    given = np.array(wrench_of(MIXER.mix(done.thrust))) / SCALE
    assert np.linalg.norm(given - believed) <= 0.25 * max(0.5, float(np.linalg.norm(believed)))


@pytest.mark.parametrize(
    ("axis", "channel", "sign"),
    [(0, 4, 1), (1, 5, 1), (2, 2, -1), (3, 1, 1), (4, 0, 1), (5, 3, 1)],
)
def test_each_axis_has_its_channel_and_sign(axis: int, channel: int, sign: int) -> None:
    """Forward, right and up, roll right, pitch up and yaw right are above 1500."""
    wrench = np.zeros(6)
    wrench[axis] = SCALE[axis] * 0.8
    pulses = MIXER.mix(tuple((INVERSE @ wrench).tolist())).pulses
    assert (pulses[channel] - 1500) * sign > 40
    group = (3, 4, 5) if channel in (3, 4, 5) else (0, 1, 2)  # the others level it: lever arms
    assert all(abs(pulses[n] - 1500) <= 5 for n in group if n != channel), pulses


def test_thrust_at_the_edge_of_the_dead_band_is_not_rounded_to_nothing() -> None:
    edge = THRUSTERS[4].dead_band
    mixed = MIXER.mix((0.0, 0.0, 0.0, 0.0, edge, edge, edge, edge))
    assert all(newtons > 0.0 for newtons in mixed.thrust[4:])


def test_a_thrust_bias_is_no_wrench() -> None:
    assert MIXER.mix((0.0,) * 8).pulses == (1500,) * 6
    against = np.array([2.0, 2.0, -2.0, -2.0, 0.0, 0.0, 0.0, 0.0])
    assert total_wrench(COLUMNS, against.tolist()) == pytest.approx((0.0,) * 6, abs=1e-9)
    assert MIXER.mix(tuple(against.tolist())).pulses == (1500,) * 6
    plain = INVERSE @ np.array([25.0, 0.0, 20.0, 0.0, 0.0, 3.0])
    both, alone = (wrench_of(MIXER.mix(tuple(t.tolist()))) for t in (plain + against, plain))
    assert both == pytest.approx(alone, abs=0.6)


def test_lower_acro_yaw_p_is_made_up_for_until_the_channel_is_full() -> None:
    half = Mixer(FRAMES[2], THRUSTERS, CHANNELS, yaw_scale=0.5)
    turn = np.zeros(6)
    turn[5] = 2.0
    thrust = tuple((INVERSE @ turn).tolist())
    assert wrench_of(half.mix(thrust))[5] == pytest.approx(2.0, rel=0.05)
    most = half.mix(tuple((INVERSE @ (turn * 10)).tolist()))
    assert most.limited
    assert most.pulses[3] == 1900


def test_other_vehicles_are_not_this_frame() -> None:
    with pytest.raises(ValueError, match="has 6 motors and the vehicle file has 8"):
        senses(FRAMES[1], THRUSTERS)
    swapped = [THRUSTERS[1], THRUSTERS[0], *THRUSTERS[2:]]
    with pytest.raises(ValueError, match="motor 1 of VECTORED_6DOF does not push as thruster 1"):
        senses(FRAMES[2], swapped)
    turned = [replace(THRUSTERS[0], direction=(-1.0, 1.0, 0.0)), *THRUSTERS[1:]]
    assert senses(FRAMES[2], turned)[0] == -senses(FRAMES[2], THRUSTERS)[0]


@given(st.floats(-1.0, 1.0), st.booleans(), st.sampled_from(["4.5", "4.8"]))
def test_a_channel_is_read_back_as_it_was_written(share: float, turned: bool, version: str) -> None:
    trim = 1100.0 if version == "4.5" else 1500.0
    channel = RcChannel(1100.0, trim, 1900.0, turned)
    assert channel.share(channel.pulse(share)) == pytest.approx(share, abs=1e-9)
    assert channel.pulse(0.0) == 1500.0
