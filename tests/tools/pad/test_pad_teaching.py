"""A profile from what a pilot presses, replayed from recorded states of a pad."""

import tomllib
from pathlib import Path
from typing import get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.gamepad.core import Button, Buttons, Grip, PadProfile, StickGain, Tilt, sticks_of
from services.piloting.sticks import Sticks
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import read
from tools.__main__ import main
from tools.pad.command import AXES, meanings, show, teach
from tools.pad.teaching import STEPS, Teaching, asked, toml_of

REST: dict[str, float] = dict.fromkeys((*AXES, *get_args(Button)), 0.0)
DEFAULT = PadProfile()
# Another hand than the default's: every control is a different one, or inverted.
WANTED = (
    "lefty", "-leftx", "-righty", "-rightx", "rightshoulder", "leftshoulder",
    "y", "a", "guide", "x", "rightstick", "back",
)  # fmt: skip


def state(control: str, travel: float = 1.0) -> dict[str, float]:
    sign = -1.0 if control.startswith("-") else 1.0
    return {**REST, control.removeprefix("-"): sign * travel}


def presses(*controls: str) -> list[dict[str, float]]:
    """Each is pushed in steps, held, and let go, as a pad reports it."""
    states = [REST]
    for control in controls:
        travels = (0.4, 0.8, 1.0, 1.0, 0.5, 0.0) if control.lstrip("-")[-1] in "xy" else (1.0, 0.0)
        states += [state(control, travel) for travel in travels]
    return states


def taught(states: list[dict[str, float]], base: PadProfile = DEFAULT) -> Teaching:
    teaching = Teaching(base)
    for controls in states:
        teaching = teaching.read(controls)
    return teaching


def test_a_profile_is_what_the_pilot_pressed_in_turn():
    teaching = taught(presses(*WANTED))
    assert teaching.step is None
    assert teaching.chosen == WANTED
    profile = teaching.profile()
    full = StickGain().normal
    assert sticks_of(state("lefty"), profile) == Sticks(surge=full)
    assert sticks_of(state("-rightx"), profile) == Sticks(yaw=full)
    assert profile.button.stop == "rightstick"
    assert (profile.dead_band, profile.expo) == (DEFAULT.dead_band, DEFAULT.expo)


controls = st.sampled_from([*REST, "-leftx", "-lefty", "-rightx", "-righty"])


@given(st.lists(controls, max_size=60))
def test_whatever_is_pressed_every_profile_is_a_valid_one_without_a_control_twice(
    pressed: list[str],
):
    teaching = taught(presses(*pressed))
    names = [control.removeprefix("-") for control in teaching.chosen]
    assert len(names) == len(set(names))
    if teaching.step is None:
        assert msgspec.convert(msgspec.to_builtins(teaching.profile()), PadProfile)
    assert all(len(line) <= 80 for line in asked(teaching)[3:])
    assert len(asked(teaching)) <= 7


@given(st.integers(0, 40), controls)
def test_a_control_that_is_held_is_taken_once(held: int, control: str):
    assert len(taught([REST, *[state(control)] * held]).chosen) <= 1


def test_what_cannot_be_taken_is_said_with_its_reason():
    wrong = taught(presses("a"))
    assert (wrong.chosen, wrong.said) == ((), "a is not a stick, which this needs")
    twice = taught(presses("lefty", "-lefty"))
    assert twice.chosen == ("lefty",)
    assert twice.said == "-lefty is taken for surge: use another"
    both = taught([REST, {**state("lefty"), "leftx": -1.0}])
    assert "one at a time" in both.said
    assert "one at a time" in asked(both)[1]


def test_enter_keeps_what_the_base_has_unless_it_is_taken():
    teaching = Teaching(DEFAULT)
    for _ in STEPS:
        teaching = teaching.keep()
    assert teaching.profile() == DEFAULT
    assert taught(presses("rightx")).keep().said == "rightx is taken for surge: use another"


@given(st.text(max_size=30))
def test_the_file_reads_as_the_profile_that_was_written(name: str):
    profile = taught(
        presses(*WANTED), PadProfile(dead_band=0.2, gain=StickGain(slow=0.1))
    ).profile()
    tree = tomllib.loads(toml_of(profile, name))
    assert msgspec.convert(tree, PadProfile) == profile


def test_a_button_that_is_taken_for_a_step_has_no_tool():
    buttons = Buttons(light="dpleft", laser="rightstick")
    tilt = Tilt(up="dpright", down="dpdown")
    base = PadProfile(tilt=tilt, gripper=Grip(open="y", close="dpup"), button=buttons)
    profile = taught(presses(*WANTED), base).profile()
    assert (profile.gripper, profile.button.laser) == (Grip(close="dpup"), None)
    assert meanings(profile)["dpup"] == "gripper closes"


class Recorded:
    """A pad that plays recorded states, one for each reading."""

    name, events_hz = "Recorded", 5.0

    def __init__(self, states: list[dict[str, float]]) -> None:
        self._states = iter(states)

    def read(self, now_s: float) -> dict[str, float]:  # noqa: ARG002
        if (controls := next(self._states, None)) is None:
            raise LindyError("the pad Recorded was unplugged; nothing was written")
        return controls


def test_a_session_ends_with_the_profile_or_with_the_pad(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def at_once(_: float) -> None:
        pass

    monkeypatch.setattr("time.sleep", at_once)
    profile = teach(Recorded(presses(*WANTED)), DEFAULT)
    assert profile == taught(presses(*WANTED)).profile()
    with pytest.raises(LindyError, match="unplugged"):
        show(Recorded([REST] * 3), DEFAULT)
    assert "1 of 12" in capsys.readouterr().out


def test_a_file_that_exists_is_refused_before_anything_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    mine = tmp_path / "mine.toml"
    mine.write_text("kept")
    assert main(["pad", "--write", str(mine)]) == 1
    assert "it exists already; choose another --write" in capsys.readouterr().err
    assert mine.read_text() == "kept"


def test_a_written_profile_is_read_by_the_service(tmp_path: Path):
    mine = tmp_path / "mine.toml"
    profile = taught(presses(*WANTED)).profile()
    mine.write_text(toml_of(profile, "Pad"))
    assert read(mine, PadProfile) == profile
