"""Stick positions, and what a stick source reads at one instant."""

from typing import NamedTuple

from messages.link import LinkRequest
from messages.simulator import FaultRequest
from services.piloting.pilot_intents import Intent

# Of a script: a part of the simulated vehicle fails, or the emulated link changes.
Incident = FaultRequest | LinkRequest


class Sticks(NamedTuple):
    """-1 … 1 each, SNAME signs: + forward, starboard, down, clockwise; the camera + upwards, the
    gripper + opens."""

    surge: float = 0.0
    sway: float = 0.0
    heave: float = 0.0
    yaw: float = 0.0
    tilt: float = 0.0
    gripper: float = 0.0

    @property
    def at_rest(self) -> bool:
        """No stick moves the drone. Camera and gripper may move: that does not prevent arming."""
        return not any(self[:4])


CENTRED = Sticks()


class StickReading(NamedTuple):
    """What a stick source reads at one instant."""

    sticks: Sticks = CENTRED
    present: bool = True  # False: the pad is unplugged, unlike centred
    at_rest: bool = True  # the device's sticks are centred, even where `sticks` is held at 0
    age_ms: float = 0.0  # [ms] since the device last answered
    presses: tuple[Intent, ...] = ()  # requests since the last reading, from a button or a script
    incidents: tuple[Incident, ...] = ()  # of a script, since the last reading
