"""From a pad's controls to stick positions: dead-band, expo, gain and which control is which; and
whether a pad that is still plugged in has stopped answering.

A pad's state is a dictionary of SDL's GameController names, the same for every pad that SDL
knows: sticks -1 … 1 (right and down positive), triggers 0 … 1, buttons 0 or 1.

A Bluetooth pad whose radio link breaks stays "connected" until the link's supervision timeout ends,
20 s by default, and all the while its last stick positions are repeated as if a hand held them. SDL
and evdev report only changes, so most of the time such a pad looks like one that is held still. One
thing can be known nevertheless: a stick that is deflected, but not against its stop, is held by a
hand, and no hand holds a stick on one and the same count. Where none of the pad's controls changes
for `silent_after`, the pad is lost.

What cannot be seen: that a pad has stopped answering with centred sticks, which moves nothing; and
with a stick against its stop, where a hand that presses does not move it either.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple, Protocol

import msgspec

from messages.units import Name, Ns, Share
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


STICKS = (("leftx", "lefty"), ("rightx", "righty"))
STOP = 0.9  # [-] from this deflection on a stick may lean against its stop


class PadAnswer(NamedTuple):
    """What is known of a pad that is plugged in."""

    age_ns: Ns = 0  # [ns] since it last answered; 0 also where its silence means nothing
    lost: bool = False


@dataclass(slots=True)
class PadSilence:
    """Of one pad, from when it was plugged in."""

    silent_after: float  # [s]
    dead_band: float  # [-]
    _before: dict[str, float] = field(default_factory=dict[str, float])
    _changed_at: Ns | None = None

    def read(self, controls: Mapping[str, float], now: Ns) -> PadAnswer:
        """`controls`: the pad's state in SDL's names, at `now` [ns]."""
        if controls != self._before or self._changed_at is None:
            self._before, self._changed_at = dict(controls), now
        age_ns = now - self._changed_at
        if age_ns >= self.silent_after * 1e9 and held_by_a_hand(controls, self.dead_band):
            return PadAnswer(age_ns, lost=True)
        return PadAnswer()

    def still_ns(self, now: Ns) -> Ns:
        """[ns] Since any of its controls changed."""
        return 0 if self._changed_at is None else now - self._changed_at


def held_by_a_hand(controls: Mapping[str, float], dead_band: float) -> bool:
    """Is a stick deflected so that only a hand can hold it there, freely?"""
    for names in STICKS:
        x, y = (abs(controls.get(name, 0.0)) for name in names)
        if max(x, y) > dead_band and x * x + y * y < STOP * STOP:
            return True
    return False
