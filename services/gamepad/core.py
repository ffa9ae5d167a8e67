"""From a pad's controls to stick positions: dead-band, expo, gain and which control is which.

A pad's state is a dictionary of SDL's GameController names, the same for every pad that SDL
knows: sticks -1 … 1 (right and down positive), triggers 0 … 1, buttons 0 or 1.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Literal, Protocol

import msgspec

from messages.units import Name, Share
from services.piloting.pilot_intents import Press
from services.piloting.sticks import StickReading, Sticks

DeadBand = Annotated[float, msgspec.Meta(ge=0.0, le=0.9)]
SilentAfter = Annotated[float, msgspec.Meta(ge=1.0, le=3600.0)]
StickName = Literal["leftx", "lefty", "rightx", "righty", "-leftx", "-lefty", "-rightx", "-righty"]
Trigger = Literal["lefttrigger", "righttrigger", "leftshoulder", "rightshoulder"]
Button = Literal[
    "a", "b", "x", "y", "back", "guide", "start", "leftstick", "rightstick",
    "leftshoulder", "rightshoulder", "dpup", "dpdown", "dpleft", "dpright",
]  # fmt: skip


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    profile: str = "default"  # a pad profile in deploy/pads, or the path of one
    pilot: Name = ""  # the pilot's name, for other pilots; empty: that of the pad or script


class StickGain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Command at full stick deflection, as a share of the most there is."""

    slow: Share = 0.25  # [-] for careful work
    normal: Share = 0.6  # [-]
    boost: Share = 1.0  # [-]

    def __post_init__(self) -> None:
        if not self.slow <= self.normal <= self.boost:
            raise ValueError("gains must not fall from slow to normal to boost")

    def level(self, slow: float, boost: float) -> float:
        """Gain for how far the two triggers are pulled (0 … 1). Continuous, so that a trigger
        causes no jump in the command; both pulled fully nearly cancel out."""
        more = boost * (self.boost - self.normal)
        less = slow * (self.normal - self.slow)
        return min(self.normal + more - less, self.boost)


class StickAxes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which stick controls which axis. SDL counts up as negative; a leading `-` inverts a stick."""

    surge: StickName = "-righty"  # stick up is forward
    sway: StickName = "rightx"
    heave: StickName = "lefty"  # stick up is up, which is negative in NED
    yaw: StickName = "leftx"


class Triggers(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    slow: Trigger = "lefttrigger"
    boost: Trigger = "righttrigger"


class Buttons(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    arm: Button = "start"
    disarm: Button = "back"
    stop: Button = "b"
    light: Button = "y"
    light_2: Button | None = None  # the second dimmer of the vehicle file; None: no button
    laser: Button | None = None  # its first switch


class Tilt(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Buttons that tilt the camera at full speed while they are held; the gain does not apply."""

    up: Button = "dpup"
    down: Button = "dpdown"


class Grip(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Buttons that move the gripper while they are held; None: no button."""

    open: Button | None = None
    close: Button | None = None


class PadProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A pad as its TOML file describes it."""

    dead_band: DeadBand = 0.12  # [-] share of a stick's travel that counts as centred
    expo: Share = 0.4  # [-] 0: straight; 1: cubic, finest around the centre
    silent_after: SilentAfter = 5.0  # [s] a stick that a hand holds cannot be this still: pad lost
    gain: StickGain = StickGain()
    axis: StickAxes = StickAxes()
    trigger: Triggers = Triggers()
    tilt: Tilt = Tilt()
    gripper: Grip = Grip()
    button: Buttons = Buttons()

    def __post_init__(self) -> None:
        tables = ("button", self.button), ("tilt", self.tilt), ("gripper", self.gripper)
        taken = dict[str, str]()
        for table, held in tables:
            for action, button in msgspec.structs.asdict(held).items():
                here = f"{table}.{action}"
                if button is not None and (other := taken.setdefault(button, here)) != here:
                    raise ValueError(f"{other} and {here} must not share the button {button}")


class StickSource(Protocol):
    """A pad, a keyboard or a script."""

    name: str
    played: int  # events of a script that have happened; 0 for a device

    def read(self, now: int, began: int | None) -> StickReading:
        """The sticks at `now` [ns]; `began` is when they were handed over, None before that."""
        ...

    def next_ns(self, now: int, began: int) -> int | None:
        """[ns] When the source changes by itself; None: only at the next regular reading."""
        ...


def shape(travel: float, dead_band: float, expo: float) -> float:
    """Dead-band and expo on one stick.

    Odd, monotonic, 0 inside the dead-band, continuous at its edge, ±1 at full travel.

    Args:
        travel: [-] -1 … 1; beyond that counts as full, NaN as centred.
        dead_band: [-] 0 … 0.9
        expo: [-] 0 (straight) … 1 (cubic)

    Returns:
        [-] -1 … 1
    """
    beyond = (min(abs(travel), 1.0) - dead_band) / (1.0 - dead_band)
    if not beyond > 0.0:
        return 0.0
    return math.copysign(beyond * (1.0 - expo * (1.0 - beyond * beyond)), travel)


def sticks_of(controls: Mapping[str, float], profile: PadProfile) -> Sticks:
    """The sticks of a pad, shaped by its profile. A control that is not there is at rest."""
    tilt = controls.get(profile.tilt.up, 0.0) - controls.get(profile.tilt.down, 0.0)
    pulls = (controls.get(name, 0.0) for name in msgspec.structs.astuple(profile.trigger))
    gain = profile.gain.level(*pulls)
    axes = (_travel(controls, name) for name in msgspec.structs.astuple(profile.axis))
    shaped = (gain * shape(axis, profile.dead_band, profile.expo) for axis in axes)
    grip = profile.gripper
    gripper = _down(controls, grip.open) - _down(controls, grip.close)
    return Sticks(*shaped, tilt=tilt, gripper=gripper)


def presses_of(pressed: list[str], profile: PadProfile) -> tuple[Press, ...]:
    """What the pilot asks for at once with buttons, in the order they were pressed."""
    b = profile.button
    meaning: dict[str | None, Press] = {
        b.stop: "stop", b.light: "light", b.light_2: "light_2", b.laser: "laser"
    }  # fmt: skip
    return tuple(meaning[name] for name in pressed if name in meaning)


def held_of(controls: Mapping[str, float], profile: PadProfile) -> set[Press]:
    """What the pilot asks for with buttons that have to be held, as long as they are."""
    meaning: dict[Press, str] = {"arm": profile.button.arm, "disarm": profile.button.disarm}
    return {press for press, name in meaning.items() if controls.get(name, 0.0)}


def _down(controls: Mapping[str, float], button: str | None) -> float:
    return 0.0 if button is None else controls.get(button, 0.0)


def _travel(controls: Mapping[str, float], name: str) -> float:
    if name.startswith("-"):
        return -controls.get(name[1:], 0.0)
    return controls.get(name, 0.0)
