"""`lindy pad`: shows what a pad sends, and what a profile makes of it."""

import sys
import time
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Annotated, Protocol

from cyclopts import Parameter
from rich.text import Text

from services.gamepad.core import PadProfile, sticks_of
from services.gamepad.io import sdl
from services.runtime.config.settings import deploy_file, read
from tools.live.screen import bar, drawn_anew

READ_S = 0.02  # [s]
SCREEN_S, LINES_S = 0.1, 1.0  # [s] between two pictures on a terminal, elsewhere
AXES = ("leftx", "lefty", "rightx", "righty", "lefttrigger", "righttrigger")


def pad(
    profile: Annotated[
        str, Parameter(help="a name in deploy/pads, or the path of a TOML file")
    ] = "default",
    /,
) -> int:
    """Show what a pad sends, and what a profile makes of it.

    It shows sticks, triggers and buttons in SDL's names, how often they
    change, and what the profile makes of them, until Ctrl-C.

    Example: lindy pad mine.toml
    """
    base = read(deploy_file("pads", profile), PadProfile)
    sdl.load()
    from tools.pad.device import Device  # here: it needs pygame

    with Device() as device:
        show(device, base)
    return 0


class AnyPad(Protocol):
    name: str

    @property
    def events_hz(self) -> float: ...

    def read(self, now_s: float) -> dict[str, float]: ...


def show(pad: AnyPad, profile: PadProfile) -> None:
    """Until Ctrl-C: on a terminal ten times a second, elsewhere once a second."""
    on_terminal, next_s = sys.stdout.isatty(), 0.0
    with drawn_anew() if on_terminal else nullcontext() as draw:
        while True:
            now_s = time.monotonic()
            controls = pad.read(now_s)
            if now_s >= next_s:
                next_s = now_s + (SCREEN_S if on_terminal else LINES_S)
                text = "\n".join(lines(pad, controls, profile))
                if draw is None:
                    print(text, flush=True)
                else:
                    draw(lambda _, text=text: Text(text, no_wrap=True))
            time.sleep(READ_S)


def meanings(profile: PadProfile) -> dict[str, str]:
    """Control, in SDL's names → what it does."""
    axis, tilt = profile.axis, profile.tilt
    found = {
        getattr(axis, name).removeprefix(
            "-"
        ): f"{name}{' (inverted)' if getattr(axis, name).startswith('-') else ''}"
        for name in axis.__struct_fields__
    }
    for name in profile.trigger.__struct_fields__:
        found[getattr(profile.trigger, name)] = name
    found |= {tilt.up: "camera up", tilt.down: "camera down"}
    tools = {profile.gripper.open: "gripper opens", profile.gripper.close: "gripper closes"}
    buttons = {getattr(profile.button, name): name for name in profile.button.__struct_fields__}
    return found | {c: what for c, what in (tools | buttons).items() if c is not None}


def lines(pad: AnyPad, controls: Mapping[str, float], profile: PadProfile) -> list[str]:
    """Everything that the pad sends now; `controls` is its state in SDL's names."""
    means = meanings(profile)
    shown = [f"{pad.name}   {pad.events_hz:.0f} changes/s"]
    shown += [
        f"{axis:<13} {bar(controls[axis])} {controls[axis]:+.3f}   {means.get(axis, '')}".rstrip()
        for axis in AXES
        if axis in controls
    ]
    down = [control for control, value in controls.items() if control not in AXES and value]
    pressed = [f"{each} ({means.get(each, 'nothing')})" for each in down]
    shown.append(f"buttons       {', '.join(pressed) or 'none'}")
    moved = "  ".join(
        f"{axis} {value:+.2f}" for axis, value in sticks_of(controls, profile)._asdict().items()
    )
    return [*shown, f"drone gets    {moved}"]
