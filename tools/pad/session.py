"""Reads a pad until the user or the time ends it, and shows what it sends and what a profile makes
of it: on a terminal ten times a second, elsewhere once a second."""

import select
import sys
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Protocol

from rich.live import Live
from rich.text import Text

from services.gamepad.core import PadProfile, sticks_of
from services.runtime.config.errors import LindyError
from tools.live.screen import bar
from tools.pad.teaching import Teaching, asked

READ_S = 0.02  # [s]
SCREEN_S, LINES_S = 0.1, 1.0  # [s] on a terminal, elsewhere
AXES = ("leftx", "lefty", "rightx", "righty", "lefttrigger", "righttrigger")
Show = Callable[[float, Callable[[], list[str]]], None]


class AnyPad(Protocol):
    name: str

    @property
    def events_hz(self) -> float: ...

    def read(self, now_s: float) -> dict[str, float]: ...


def show(pad: AnyPad, profile: PadProfile, seconds: float | None) -> None:
    """Until `seconds` are over; None: until Ctrl-C."""
    with shown() as put:
        for now_s in _readings(seconds):
            controls = pad.read(now_s)
            put(now_s, lambda c=controls: lines(pad.name, c, pad.events_hz, profile))


def teach(pad: AnyPad, base: PadProfile, seconds: float | None) -> PadProfile:
    """Ask for every action in turn.

    Raises:
        LindyError: the time was over before the last one.
    """
    teaching = Teaching(base)
    with shown() as put:
        for now_s in _readings(seconds):
            controls = pad.read(now_s)
            teaching = teaching.keep() if _entered() else teaching.read(controls)
            if teaching.step is None:
                return teaching.profile()
            put(now_s, lambda c=controls, t=teaching: _asking(pad, c, t))
    raise LindyError("--seconds ended before the last action; nothing was written")


def _asking(pad: AnyPad, controls: dict[str, float], teaching: Teaching) -> list[str]:
    return [*lines(pad.name, controls, pad.events_hz, None), "", *asked(teaching)]


def _readings(seconds: float | None) -> Iterator[float]:
    """[s] The time of each reading."""
    began_s = time.monotonic()
    while seconds is None or time.monotonic() < began_s + seconds:
        yield time.monotonic()
        time.sleep(READ_S)


def _entered() -> bool:
    """Has the user pressed Enter?"""
    if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
        return False
    return sys.stdin.readline() != ""


@contextmanager
def shown() -> Generator[Show]:
    next_s = 0.0
    with ExitStack() as exits:
        here = sys.stdout.isatty()
        live = exits.enter_context(Live(auto_refresh=False)) if here else None

        def put(now_s: float, look: Callable[[], list[str]]) -> None:
            nonlocal next_s
            if now_s < next_s:
                return
            next_s = now_s + (LINES_S if live is None else SCREEN_S)
            if live is None:
                print(*look(), sep="\n", flush=True)
            else:
                live.update(Text("\n".join(look()), no_wrap=True), refresh=True)

        yield put


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
