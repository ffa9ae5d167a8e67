"""Who flies a dive from this machine: the pilot that was chosen, or a gamepad that is there."""

import os
import subprocess
import sys
from collections.abc import Collection

from services.runtime.config.errors import LindyError
from tools.checks import DEFAULT_PILOT, PilotChoice, pilot_of
from tools.choices import Choices

GAMEPAD = "gamepad"  # the pilot, unless the stack has one of these in its place
IN_PLACE = {"mavlink": "a ground station", "cockpit": "a browser", "ros2": "a node of ROS 2"}
PAD_S = 5.0  # [s] for SDL to answer
QUESTION = """
import pygame
pygame.display.init()
pygame.joystick.init()
from pygame._sdl2 import controller
controller.init()
print(sum(controller.is_controller(n) for n in range(pygame.joystick.get_count())))
"""
QUIET = {
    "SDL_VIDEODRIVER": "dummy",
    "SDL_AUDIODRIVER": "dummy",
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
}


def who_flies(
    choices: Choices, services: Collection[str], *, elsewhere: bool = False
) -> PilotChoice:
    """The pilot that the user chose; else the gamepad; else, where none is plugged in, a script.
    Where the stack has a ground station or a browser in place of the gamepad, it is the pilot.

    Args:
        elsewhere: the drone is another program's, perhaps a real one: no script flies that nobody
            has chosen.

    Raises:
        LindyError: no such pilot, a mistake in the script, or nobody to fly.
    """
    others = [name for name in IN_PLACE if name in services]
    if others and GAMEPAD not in services:
        if choices.pilot is not None:
            raise LindyError(
                f"--pilot {choices.pilot}: {IN_PLACE[others[0]]} flies in the stack "
                f"{choices.stack}; allowed with a stack that has [services.{GAMEPAD}]"
            )
        return PilotChoice(others[0])
    if choices.pilot is None and not pad_is_there():
        if elsewhere:
            raise LindyError(
                "no gamepad is plugged in: plug one in, or say who flies, with --pilot keyboard, "
                f"--pilot {DEFAULT_PILOT} or another script"
            )
        return pilot_of(DEFAULT_PILOT)
    return pilot_of(choices.pilot or "gamepad")


def tell_who_flies(choices: Choices, pilot: PilotChoice) -> None:
    """Announce a script that the user did not choose."""
    if choices.pilot is None and pilot.script_s is not None:
        print(f"no gamepad is plugged in: {DEFAULT_PILOT} flies", flush=True)


def pad_is_there() -> bool:
    """Ask SDL in a short process of its own. A joystick without an SDL mapping, such as an
    accelerometer or a steering wheel, does not count. Without pygame there is no pad."""
    try:
        answer = subprocess.run(
            [sys.executable, "-P", "-c", QUESTION],
            env={**os.environ, **QUIET},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PAD_S,
            check=True,
        )
    except (subprocess.SubprocessError, OSError):
        return False
    return answer.stdout.strip() not in (b"", b"0")
