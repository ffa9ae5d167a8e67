"""A pad that is plugged in, through SDL. Import it after `sdl.load()`."""

from collections import deque

import pygame
from pygame._sdl2 import controller

from services.gamepad.io import sdl
from services.gamepad.io.pad import controls_of
from services.runtime.config.errors import LindyError

CHANGES = (
    pygame.CONTROLLERAXISMOTION,
    pygame.CONTROLLERBUTTONDOWN,
    pygame.CONTROLLERBUTTONUP,
)
SECOND = 1.0  # [s] over which changes are counted


class Device:
    """The first pad that SDL knows."""

    def __init__(self) -> None:
        """Raises LindyError: there is none."""
        sdl.start_events()
        pygame.joystick.init()
        controller.init()
        pygame.event.pump()
        self._pad = _first()
        self._id = self._pad.as_joystick().get_instance_id()
        self.name = str(self._pad.name)
        self._changes: deque[float] = deque()  # [s] when

    def read(self, now_s: float) -> dict[str, float]:
        """Its state in SDL's names.

        Raises:
            LindyError: it was unplugged.
        """
        for event in pygame.event.get():
            if event.type in CHANGES and event.instance_id == self._id:
                self._changes.append(now_s)
        while self._changes and self._changes[0] < now_s - SECOND:
            self._changes.popleft()
        if not self._pad.attached():
            raise LindyError(f"the pad {self.name} was unplugged")
        return controls_of(self._pad)

    @property
    def events_hz(self) -> float:
        """[1/s] changes over the last second."""
        return len(self._changes) / SECOND

    def __enter__(self) -> "Device":
        return self

    def __exit__(self, *_: object) -> None:
        controller.quit()
        pygame.joystick.quit()
        pygame.display.quit()


def _first() -> controller.Controller:
    count = pygame.joystick.get_count()
    for index in range(count):
        if controller.is_controller(index):
            return controller.Controller(index)
    if count == 0:
        raise LindyError("no pad is plugged in; plug one in, or fly with --pilot keyboard")
    name = pygame.joystick.Joystick(0).get_name()
    raise LindyError(
        f"SDL does not know the pad {name!r}; "
        "describe it in the environment variable SDL_GAMECONTROLLERCONFIG"
    )
