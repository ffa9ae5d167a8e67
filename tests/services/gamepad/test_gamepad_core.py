"""The law from a stick's travel to what is commanded."""

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.gamepad.core import (
    Buttons,
    Grip,
    PadProfile,
    StickGain,
    Tilt,
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
laws = settings(max_examples=100, deadline=None)


@laws
@given(travels, dead_bands, shares)
def test_a_shaped_stick_is_odd_and_stays_within_full(travel: float, band: float, expo: float):
    shaped = shape(travel, band, expo)
    assert shape(-travel, band, expo) == -shaped
    assert abs(shaped) <= 1.0
    assert shaped * travel >= 0.0


@laws
@given(travels, travels, dead_bands, shares)
def test_a_shaped_stick_never_falls_as_the_stick_is_pushed_further(
    one: float, other: float, band: float, expo: float
):
    low, high = sorted((one, other))
    assert shape(low, band, expo) <= shape(high, band, expo) + 1e-12


@laws
@given(dead_bands, shares, shares)
def test_nothing_happens_inside_the_dead_band_and_nothing_jumps_at_its_edge(
    band: float, expo: float, inside: float
):
    assert shape(inside * band, band, expo) == 0.0
    just_outside = 1e-6
    slope = 1.0 / (1.0 - band)  # the steepest the law is at the edge, without expo
    assert 0.0 <= shape(band + just_outside, band, expo) <= slope * just_outside * 1.001


@laws
@given(dead_bands, shares, st.sampled_from([1.0, 1.0001, 5.0, float("inf")]))
def test_full_travel_is_exactly_one_and_expo_makes_the_middle_finer(
    band: float, expo: float, full: float
):
    assert shape(full, band, expo) == 1.0
    assert shape(-full, band, expo) == -1.0
    assert shape(float("nan"), band, expo) == 0.0
    assert (shape(0.5, 0.0, 0.0), shape(0.5, 0.0, 1.0)) == (0.5, 0.125)


@laws
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
def test_each_stick_moves_its_own_axis_and_no_other(
    control: str, full: float, axis: str, sign: float
):
    normal = Sticks(**{axis: sign * 0.6})
    assert sticks_of({control: full}, PadProfile()) == normal
    assert sticks_of({control: full, "righttrigger": 1.0}, PadProfile()) == Sticks(**{axis: sign})
    slow = sticks_of({control: full, "lefttrigger": 1.0}, PadProfile())
    assert slow == pytest.approx(Sticks(**{axis: sign * 0.25}))


@laws
@given(
    st.dictionaries(
        st.sampled_from(
            ["leftx", "lefty", "rightx", "righty", "lefttrigger", "righttrigger", "a", "start"]
        ),
        travels,
    )
)
def test_no_state_of_a_pad_commands_more_than_full(controls: dict[str, float]):
    controls = {name: abs(x) if "trigger" in name else x for name, x in controls.items()}
    assert all(-1.0 <= stick <= 1.0 for stick in sticks_of(controls, PadProfile()))


@laws
@given(gains, shares, shares, st.booleans(), st.booleans())
def test_the_camera_turns_at_full_speed_whatever_the_gain_and_both_buttons_cancel(
    gain: StickGain, slow: float, boost: float, up: bool, down: bool
):
    held = {"x": float(up), "a": float(down), "dpdown": 1.0}
    triggers = {"lefttrigger": slow, "righttrigger": boost}
    profile = PadProfile(gain=gain, tilt=Tilt(up="x", down="a"))
    assert sticks_of(held | triggers, profile) == Sticks(tilt=float(up) - float(down))


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


def test_a_button_opens_or_closes_the_gripper_while_it_is_held():
    profile = PadProfile(gripper=Grip(open="x", close="a"))
    for held, moves in (((), 0.0), (("x",), 1.0), (("a",), -1.0), (("a", "x"), 0.0)):
        assert sticks_of(dict.fromkeys(held, 1.0), profile) == Sticks(gripper=moves)


@pytest.mark.parametrize(
    ("tree", "says"),
    [
        ({"dead_band": 1.0}, "dead_band"),
        ({"gain": {"slow": 0.9}}, "gains must not fall"),
        ({"axis": {"surge": "leftz"}}, "leftz"),
        ({"button": {"light": "dpup"}}, "button.light and tilt.up must not share the button dpup"),
        ({"tilt": {"up": "x", "down": "x"}}, "tilt.up and tilt.down must not share"),
        ({"gripper": {"open": "b"}}, "button.stop and gripper.open must not share"),
        ({"button": {"laser": "b"}}, "button.stop and button.laser must not share"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_profile_that_makes_no_sense_is_refused(tree: dict[str, object], says: str):
    with pytest.raises(msgspec.ValidationError, match=says):
        msgspec.convert(tree, PadProfile)
