"""The law from a stick's travel to what is commanded."""

import msgspec
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from services.gamepad.core import (
    STOP,
    Buttons,
    Grip,
    PadProfile,
    PadSilence,
    StickGain,
    held_by_a_hand,
    held_of,
    presses_of,
    shape,
    sticks_of,
)
from services.piloting.sticks import Sticks
from services.runtime.config.settings import deploy_file, read

travels = st.floats(-1.0, 1.0)
dead_bands = st.floats(0.0, 0.9)
shares = st.floats(0.0, 1.0)
gains = st.lists(shares, min_size=3, max_size=3).map(sorted).map(lambda levels: StickGain(*levels))


@given(travels, dead_bands, shares)
def test_a_shaped_stick_is_odd_and_stays_within_full(travel: float, band: float, expo: float):
    shaped = shape(travel, band, expo)
    assert shape(-travel, band, expo) == -shaped
    assert abs(shaped) <= 1.0
    assert shaped * travel >= 0.0


@given(travels, travels, dead_bands, shares)
def test_a_shaped_stick_never_falls(one: float, other: float, band: float, expo: float):
    low, high = sorted((one, other))
    assert shape(low, band, expo) <= shape(high, band, expo) + 1e-12


@given(dead_bands, shares, shares)
def test_the_dead_band_is_still_and_its_edge_no_jump(band: float, expo: float, inside: float):
    assert shape(inside * band, band, expo) == 0.0
    just_outside = 1e-6
    slope = 1.0 / (1.0 - band)  # the steepest the law is at the edge, without expo
    assert 0.0 <= shape(band + just_outside, band, expo) <= slope * just_outside * 1.001


@given(dead_bands, shares, st.sampled_from([1.0, 1.0001, 5.0, float("inf")]))
def test_full_travel_is_exactly_one_and_expo_makes_the_middle_finer(
    band: float, expo: float, full: float
):
    assert shape(full, band, expo) == 1.0
    assert shape(-full, band, expo) == -1.0
    assert shape(float("nan"), band, expo) == 0.0
    assert (shape(0.5, 0.0, 0.0), shape(0.5, 0.0, 1.0)) == (0.5, 0.125)


@given(gains, shares, shares)
def test_the_gain_lies_between_slow_and_boost(gain: StickGain, slow: float, boost: float):
    level = gain.level(slow, boost)
    assert gain.slow - 1e-12 <= level <= gain.boost
    assert gain.level(0.0, 0.0) == gain.normal
    assert gain.level(1.0, 0.0) == pytest.approx(gain.slow)
    assert gain.level(0.0, 1.0) == pytest.approx(gain.boost)


@pytest.mark.parametrize(
    ("control", "full", "axis", "sign"),
    [
        ("righty", -1.0, "surge", 1.0),  # right stick up: forward
        ("rightx", 1.0, "sway", 1.0),  # right stick right: starboard
        ("lefty", -1.0, "heave", -1.0),  # left stick up: rise
        ("leftx", 1.0, "yaw", 1.0),  # left stick right: clockwise
    ],
)
def test_each_stick_moves_its_own_axis_alone(control: str, full: float, axis: str, sign: float):
    normal = Sticks(**{axis: sign * 0.6})
    assert sticks_of({control: full}, PadProfile()) == normal
    assert sticks_of({control: full, "righttrigger": 1.0}, PadProfile()) == Sticks(**{axis: sign})
    slow = sticks_of({control: full, "lefttrigger": 1.0}, PadProfile())
    assert slow == pytest.approx(Sticks(**{axis: sign * 0.25}))


@given(gains, shares, shares, st.booleans(), st.booleans())
def test_camera_and_gripper_move_in_full_while_held_and_both_buttons_cancel(
    gain: StickGain, slow: float, boost: float, one: bool, other: bool
):
    triggers = {"lefttrigger": slow, "righttrigger": boost}
    held = {"x": float(one), "a": float(other), "dpup": float(other), "dpdown": float(one)}
    tools = PadProfile(gain=gain, gripper=Grip(open="x", close="a"))
    way = float(one) - float(other)
    assert sticks_of(held | triggers, tools) == Sticks(tilt=-way, gripper=way)


def test_buttons_mean_what_the_profile_says_and_the_others_nothing():
    profile = PadProfile(button=Buttons(arm="a", stop="x", light_2="b", laser="leftstick"))
    pressed = ["start", "x", "y", "a", "dpup", "b", "leftstick"]
    assert presses_of(pressed, profile) == ("stop", "light", "light_2", "laser")
    assert held_of({"a": 1.0, "start": 1.0, "back": 0.0}, profile) == {"arm"}
    assert held_of({"back": 1.0}, profile) == {"disarm"}


def test_the_shipped_profile_is_the_default_with_buttons_for_tools():
    """A profile of before has none: what it uses them for stays as it is."""
    tools = PadProfile(
        gripper=Grip(open="rightshoulder", close="leftshoulder"),
        button=Buttons(light_2="a", laser="x"),
    )
    assert read(deploy_file("pads", "default"), PadProfile) == tools


@pytest.mark.parametrize(
    ("tree", "says"),
    [
        ({"dead_band": 1.0}, "dead_band"),
        ({"gain": {"slow": 0.9}}, "gains must not fall"),
        ({"axis": {"surge": "leftz"}}, "leftz"),
        ({"button": {"light": "dpup"}}, "button.light and tilt.up must not share the button dpup"),
        ({"gripper": {"open": "b"}}, "button.stop and gripper.open must not share"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_profile_that_makes_no_sense_is_refused(tree: dict[str, object], says: str):
    with pytest.raises(msgspec.ValidationError, match=says):
        msgspec.convert(tree, PadProfile)


# A pad that stays connected and stops answering: what is known of it, and what is not.


MS, S = 1_000_000, 1_000_000_000  # [ns]
STEP = 20 * MS  # a reading
DEAD_BAND, AFTER = 0.12, 5.0
NAMES = ("leftx", "lefty", "rightx", "righty")

a_travel = st.floats(-1.0, 1.0)
travelled = st.fixed_dictionaries(dict.fromkeys(NAMES, a_travel))
in_the_dead_band = st.fixed_dictionaries(dict.fromkeys(NAMES, st.floats(-DEAD_BAND, DEAD_BAND)))


def watched() -> PadSilence:
    return PadSilence(AFTER, DEAD_BAND)


def still(pad: PadSilence, controls: dict[str, float], start: int, end: int) -> int | None:
    """The first instant at which the pad counts as lost, if none of its controls changes."""
    for now in range(start, end, STEP):
        if pad.read(controls, now).lost:
            return now
    return None


@given(in_the_dead_band)
def test_a_pad_with_centred_sticks_is_never_lost(controls: dict[str, float]):
    pad = watched()
    assert still(pad, controls, 0, 20 * S) is None
    assert pad.read(controls, 3600 * S) == (0, False)


@given(travelled, st.integers(0, 20))
def test_a_pad_that_is_frozen_with_a_stick_in_a_hand_is_lost_within_silent_after(
    controls: dict[str, float], moves: int
):
    assume(held_by_a_hand(controls, DEAD_BAND))
    pad = watched()
    for n in range(moves):
        pad.read({**controls, "lefty": n / 100}, n * STEP)
    froze = moves * STEP
    lost = still(pad, controls, froze, froze + 10 * S)
    assert lost is not None
    assert AFTER * S - STEP <= lost - froze <= AFTER * S + STEP
    later = pad.read(controls, lost + 7 * S)
    assert later.lost
    assert later.age_ns >= 7 * S + AFTER * S - STEP  # it grows


@given(travelled, st.lists(st.integers(1, int(AFTER * 50) - 1), min_size=1, max_size=8))
def test_a_pad_that_jitters_by_one_count_is_never_lost(controls: dict[str, float], gaps: list[int]):
    pad, now = watched(), 0
    for n, gap in enumerate(gaps):
        moved = {**controls, "leftx": controls["leftx"] + (n % 2) / 32767}
        for _ in range(gap):
            assert not pad.read(moved, now).lost
            now += STEP


@given(st.floats(STOP, 1.0), st.sampled_from(NAMES), st.sampled_from([-1, 1]))
def test_a_stick_against_its_stop_may_be_held_for_ever(deflection: float, name: str, sign: int):
    assert still(watched(), {name: sign * deflection}, 0, 20 * S) is None
