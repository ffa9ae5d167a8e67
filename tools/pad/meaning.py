"""What a profile makes of each control of a pad, and what a pad sends, as lines. Pure."""

from collections.abc import Mapping

from services.gamepad.core import PadProfile, sticks_of
from tools.live.screen import bar

AXES = ("leftx", "lefty", "rightx", "righty", "lefttrigger", "righttrigger")


def meanings(profile: PadProfile) -> dict[str, str]:
    """Control, in SDL's names → what it does."""
    axis, tilt = profile.axis, profile.tilt
    found = {
        getattr(axis, name).removeprefix("-"): f"{name}{_inverted(getattr(axis, name))}"
        for name in axis.__struct_fields__
    }
    for name in profile.trigger.__struct_fields__:
        found[getattr(profile.trigger, name)] = name
    found |= {tilt.up: "camera up", tilt.down: "camera down"}
    tools = {profile.gripper.open: "gripper opens", profile.gripper.close: "gripper closes"}
    buttons = {getattr(profile.button, name): name for name in profile.button.__struct_fields__}
    return found | {c: what for c, what in (tools | buttons).items() if c is not None}


def lines(
    name: str, controls: Mapping[str, float], events_hz: float, profile: PadProfile | None
) -> list[str]:
    """Everything that the pad sends now.

    Args:
        name: of the pad.
        controls: its state in SDL's names.
        events_hz: [1/s] changes that it reported over the last second.
        profile: None: nothing is said of what the controls do.
    """
    means = meanings(profile) if profile else {}
    down = [control for control, value in controls.items() if control not in AXES and value]
    shown = [f"{name}   {events_hz:.0f} changes/s"]
    shown += [
        f"{axis:<13} {bar(controls[axis])} {controls[axis]:+.3f}   {means.get(axis, '')}".rstrip()
        for axis in AXES
        if axis in controls
    ]
    pressed = [
        f"{control} ({means.get(control, 'nothing')})" if profile else control for control in down
    ]
    shown.append(f"buttons       {', '.join(pressed) or 'none'}")
    if profile is None:
        return shown
    sticks = sticks_of(controls, profile)
    moved = [f"{axis} {value:+.2f}" for axis, value in sticks._asdict().items()]
    return [*shown, f"drone gets    {'  '.join(moved)}"]


def _inverted(control: str) -> str:
    return " (inverted)" if control.startswith("-") else ""
