"""Is a gamepad plugged in that the pilot could fly with?"""

import os
import subprocess
import sys

TIMEOUT_S = 5.0
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


def pad_is_there() -> bool:
    """Ask SDL in a short process of its own. A joystick without an SDL mapping, such as an
    accelerometer or a steering wheel, does not count. Without pygame there is no pad."""
    try:
        answer = subprocess.run(
            [sys.executable, "-P", "-c", QUESTION],
            env={**os.environ, **QUIET},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=TIMEOUT_S,
            check=True,
        )
    except (subprocess.SubprocessError, OSError):
        return False
    return answer.stdout.strip() not in (b"", b"0")
