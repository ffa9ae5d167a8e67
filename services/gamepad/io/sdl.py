"""Starts pygame with pads and keyboard only: no sound, and no window unless it is needed."""

import importlib
import os
import sys
import warnings

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install

QUIETLY = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    "SDL_AUDIODRIVER": "dummy",  # machines without sound would print errors
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # a pad works while another window has the focus
    "SDL_NO_SIGNAL_HANDLERS": "1",  # Ctrl-C belongs to the host
}


def has_display() -> bool:
    """Can a window be shown? Also true where the user has set SDL's video driver."""
    wanted = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in wanted)


def load() -> None:
    """Import pygame; from here on `import pygame` cannot fail.

    Raises:
        LindyError: pygame is not installed; says how to get it.
    """
    for name, value in QUIETLY.items():
        os.environ.setdefault(name, value)
    try:
        with warnings.catch_warnings():
            # pygame imports setuptools' pkg_resources, which warns about being imported.
            warnings.filterwarnings("ignore", message=".*pkg_resources", category=Warning)
            importlib.import_module("pygame")
    except ImportError:
        raise LindyError(
            f"pads and the keyboard need pygame: {how_to_install('pilot')}; "
            "or use --pilot script:FILE"
        ) from None


def start_events() -> None:
    """Start SDL's events without a window, also where there is no display or it does not work.

    Pads report through the same events, so they need this too.
    """
    import pygame

    if not has_display():
        os.environ["SDL_VIDEODRIVER"] = "dummy"
    try:
        pygame.display.init()
    except pygame.error:
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        pygame.display.init()
