"""What `lindy pad` shows, replayed from recorded states of a pad."""

from typing import get_args

import pytest

from services.gamepad.core import Button, Buttons, Grip, PadProfile
from services.runtime.config.errors import LindyError
from tools.pad.command import AXES, lines, meanings, show

REST: dict[str, float] = dict.fromkeys((*AXES, *get_args(Button)), 0.0)


class Recorded:
    """A pad that plays recorded states, one for each reading."""

    name, events_hz = "Recorded", 5.0

    def __init__(self, states: list[dict[str, float]]) -> None:
        self._states = iter(states)

    def read(self, now_s: float) -> dict[str, float]:  # noqa: ARG002
        if (controls := next(self._states, None)) is None:
            raise LindyError("the pad Recorded was unplugged")
        return controls


def test_a_stick_and_a_button_are_shown_with_what_they_do() -> None:
    shown = "\n".join(lines(Recorded([]), {**REST, "lefty": 1.0, "b": 1.0}, PadProfile()))
    assert "Recorded   5 changes/s" in shown
    assert "b (stop)" in shown
    assert "heave +0.60" in shown
    profile = PadProfile(gripper=Grip(close="dpleft"), button=Buttons(laser=None))
    assert meanings(profile)["dpleft"] == "gripper closes"


def test_it_shows_until_the_pad_goes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(LindyError, match="unplugged"):
        show(Recorded([REST] * 3), PadProfile())
    assert capsys.readouterr().out.count("buttons       none") == 1
