"""`lindy pad`: shows what a pad sends, and writes a profile for it."""

import select
import sys
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Protocol

from cyclopts import Parameter
from rich.text import Text

from services.gamepad.core import PadProfile, sticks_of
from services.gamepad.io import sdl
from services.runtime.config.settings import deploy_file, read
from tools.choices import named
from tools.fresh import refuse_existing, write_fresh
from tools.live.display import drawn_anew
from tools.live.screen import bar
from tools.pad.teaching import Teaching, asked, toml_of

READ_S = 0.02  # [s]
SCREEN_S, LINES_S = 0.1, 1.0  # [s] between two pictures on a terminal, elsewhere
AXES = ("leftx", "lefty", "rightx", "righty", "lefttrigger", "righttrigger")
Show = Callable[[Callable[[], list[str]]], None]


def pad(
    profile: Annotated[
        str, Parameter(help="a name in deploy/pads, or the path of a TOML file")
    ] = "default",
    /,
    *,
    write: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="ask for each action in turn, and write a profile into this new file",
        ),
    ] = None,
) -> int:
    """Show what a pad sends, and write a profile for it.

    It shows sticks, triggers and buttons in SDL's names, how often they
    change, and what the profile makes of them, until Ctrl-C.

    Example: lindy pad --write mine.toml
    """
    base = read(deploy_file("pads", profile), PadProfile)
    if write is not None:
        refuse_existing(write, "--write")
    sdl.load()
    from tools.pad.device import Device  # here: it needs pygame

    with Device() as device:
        if write is None:
            show(device, base)
            return 0
        taught = teach(device, base)
    write_fresh(write, toml_of(taught, device.name).encode(), "--write")
    print(f"{write}: fly with --set gamepad.profile={write}", flush=True)
    return 0


class AnyPad(Protocol):
    name: str

    @property
    def events_hz(self) -> float: ...

    def read(self, now_s: float) -> dict[str, float]: ...


def show(pad: AnyPad, profile: PadProfile) -> None:
    """Until Ctrl-C."""
    with _shown() as put:
        for controls in _readings(pad):
            put(lambda c=controls: lines(pad, c, profile))


def teach(pad: AnyPad, base: PadProfile) -> PadProfile:
    """Ask for every action in turn."""
    teaching = Teaching(base)
    with _shown() as put:
        for controls in _readings(pad):
            teaching = teaching.keep() if _entered() else teaching.read(controls)
            if teaching.step is None:
                return teaching.profile()
            put(lambda c=controls, t=teaching: [*lines(pad, c, None), "", *asked(t)])
    raise AssertionError("a pad is read for ever")


def _readings(pad: AnyPad) -> Iterator[dict[str, float]]:
    """What the pad sends, again and again."""
    while True:
        yield pad.read(time.monotonic())
        time.sleep(READ_S)


def _entered() -> bool:
    """Has the user pressed Enter?"""
    if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
        return False
    return sys.stdin.readline() != ""


@contextmanager
def _shown() -> Generator[Show]:
    """On a terminal ten times a second, elsewhere once a second."""
    next_s = 0.0

    def due(period_s: float) -> bool:
        nonlocal next_s
        if (now_s := time.monotonic()) < next_s:
            return False
        next_s = now_s + period_s
        return True

    if not sys.stdout.isatty():
        yield lambda look: print(*look(), sep="\n", flush=True) if due(LINES_S) else None
        return
    with drawn_anew() as draw:
        yield (
            lambda look: (
                draw(lambda _: Text("\n".join(look()), no_wrap=True)) if due(SCREEN_S) else None
            )
        )


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


def lines(pad: AnyPad, controls: Mapping[str, float], profile: PadProfile | None) -> list[str]:
    """Everything that the pad sends now.

    Args:
        controls: its state in SDL's names.
        profile: None: nothing is said of what the controls do.
    """
    means = meanings(profile) if profile else {}
    shown = [f"{pad.name}   {pad.events_hz:.0f} changes/s"]
    shown += [
        f"{axis:<13} {bar(controls[axis])} {controls[axis]:+.3f}   {means.get(axis, '')}".rstrip()
        for axis in AXES
        if axis in controls
    ]
    down = [control for control, value in controls.items() if control not in AXES and value]
    pressed = [f"{each} ({means.get(each, 'nothing')})" if profile else each for each in down]
    shown.append(f"buttons       {', '.join(pressed) or 'none'}")
    if profile is not None:
        sticks = sticks_of(controls, profile)._asdict()
        moved = "  ".join(f"{axis} {value:+.2f}" for axis, value in sticks.items())
        shown.append(f"drone gets    {moved}")
    return shown
