"""Makes a pad profile, and a TOML file of it, from what a pilot presses when asked. Pure: states of
a pad in, one profile out."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import msgspec

from services.gamepad.core import Button, PadProfile, StickName, Trigger

HEAD = """\
# A pad in SDL's GameController names, made with `lindy pad` on: {name}
# Fly with it: --set gamepad.profile=THIS_FILE, or [gamepad] profile in the vehicle file.
"""
COMMENTS = {
    "dead_band": "[-] share of a stick's travel that counts as centred",
    "expo": "[-] 0: straight; 1: cubic, finest around the centre",
    "silent_after": "[s] a stick held by a hand is never this still: the pad has failed",
    "gain": "[-] command at full stick; the triggers change continuously between them",
    "axis": "SDL counts stick up as negative; a leading - inverts a stick",
    "trigger": "lefttrigger, righttrigger, leftshoulder or rightshoulder",
    "tilt": "the camera, at full speed while a button is held",
    "gripper": "moves while a button is held",
    "button": "arm also resumes after a failsafe",
}
TABLES = ("gain", "axis", "trigger", "tilt", "gripper", "button")
PUSHED, LET_GO = 0.7, 0.3  # [-] of a stick's or trigger's travel
PER_ROW = 3  # actions shown in one row
Table = Literal["axis", "trigger", "tilt", "button"]


class Step(NamedTuple):
    """One action: where it stands in a profile, and what the pilot is asked to do."""

    table: Table
    action: str
    ask: str


STEPS = (
    Step("axis", "surge", "push a stick all the way to where the drone goes AHEAD"),
    Step("axis", "sway", "push a stick all the way to where the drone goes to STARBOARD (right)"),
    Step("axis", "heave", "push a stick all the way to where the drone SINKS"),
    Step("axis", "yaw", "push a stick all the way to where the drone turns RIGHT (clockwise)"),
    Step("trigger", "slow", "pull the trigger or shoulder button for SLOW, careful work"),
    Step("trigger", "boost", "pull the trigger or shoulder button for BOOST"),
    Step("tilt", "up", "press the button that tilts the CAMERA UP"),
    Step("tilt", "down", "press the button that tilts the CAMERA DOWN"),
    Step("button", "arm", "press the button that ARMS, and resumes after a failsafe"),
    Step("button", "disarm", "press the button that DISARMS"),
    Step("button", "stop", "press the button for STOP"),
    Step("button", "light", "press the button for the LIGHT"),
)
# What a profile may be without, and is not asked for.
TOOLS = ("gripper", "open"), ("gripper", "close"), ("button", "light_2"), ("button", "laser")
A_BUTTON = get_args(Button), "a button"
ALLOWED: dict[Table, tuple[tuple[str, ...], str]] = {  # controls, and what they are
    "axis": (get_args(StickName), "a stick"),
    "trigger": (get_args(Trigger), "a trigger or a shoulder button"),
    "tilt": A_BUTTON,
    "button": A_BUTTON,
}


@dataclass(frozen=True, slots=True)
class Teaching:
    """How far the pilot has come."""

    base: PadProfile  # what stays as it is: dead-band, expo, gain; and what is kept of the rest
    chosen: tuple[str, ...] = ()  # control of each step that is done
    said: str = ""  # why the last control was not taken
    let_go: bool = False  # everything was let go since the last step

    @property
    def step(self) -> Step | None:
        """The step that is due; None: done."""
        return STEPS[len(self.chosen)] if len(self.chosen) < len(STEPS) else None

    def read(self, controls: Mapping[str, float]) -> "Teaching":
        """The pad's state now, in SDL's names."""
        step, pushed = self.step, _pushed(controls)
        if step is None or not controls:
            return self
        if not self.let_go:
            return replace(self, let_go=all(abs(v) <= LET_GO for v in controls.values()))
        if not pushed:
            return self
        if len(pushed) > 1:
            return self._refused(f"{' and '.join(pushed)} came together: one at a time")
        return self._choose(step, pushed[0])

    def keep(self) -> "Teaching":
        """Take what the base has for the step that is due."""
        step = self.step
        if step is None:
            return self
        return self._choose(step, getattr(getattr(self.base, step.table), step.action))

    def profile(self) -> PadProfile:
        """With every step done so far. A tool's button that was taken for a step has no tool."""
        tree = msgspec.to_builtins(self.base)
        for table, action in TOOLS:
            if tree[table][action] in self.chosen:
                tree[table][action] = None
        for step, control in zip(STEPS, self.chosen, strict=False):
            tree[step.table][step.action] = control
        return msgspec.convert(tree, PadProfile)

    def _choose(self, step: Step, control: str) -> "Teaching":
        allowed, kind = ALLOWED[step.table]
        if control not in allowed:
            return self._refused(f"{control} is not {kind}, which this needs")
        for before, taken in zip(STEPS, self.chosen, strict=False):
            if taken.removeprefix("-") == control.removeprefix("-"):
                return self._refused(f"{control} is taken for {before.action}: use another")
        return Teaching(self.base, (*self.chosen, control))

    def _refused(self, why: str) -> "Teaching":
        return replace(self, said=why, let_go=False)


def _pushed(controls: Mapping[str, float]) -> list[str]:
    """Controls that are used now; a stick with its sign, as a profile names it."""
    return [
        f"-{name}" if value < 0.0 else name
        for name, value in controls.items()
        if abs(value) >= PUSHED
    ]


def asked(teaching: Teaching) -> list[str]:
    """What the pilot reads: what to do next, and what is chosen."""
    pairs = zip(STEPS, teaching.chosen, strict=False)
    done = [f"{step.table} {step.action}: {control}" for step, control in pairs]
    rows = ["   ".join(done[n : n + PER_ROW]) for n in range(0, len(done), PER_ROW)]
    step = teaching.step
    if step is None:
        return rows
    kept = getattr(getattr(teaching.base, step.table), step.action)
    what = step.ask if teaching.let_go else "let go of everything"
    number = f"{len(done) + 1} of {len(STEPS)}"
    return [f"{number}  {what}", f"(Enter keeps {kept})  {teaching.said}", "", *rows]


def toml_of(profile: PadProfile, name: str) -> str:
    """`name`: of the pad, for the comment at its head."""
    printable = "".join(sign if sign.isprintable() else "?" for sign in name)
    text = HEAD.format(name=printable)
    for key in profile.__struct_fields__:
        if key not in TABLES:
            text += f"\n{key} = {getattr(profile, key)}  # {COMMENTS[key]}"
    for key in TABLES:
        table = getattr(profile, key)
        text += f"\n\n[{key}]  # {COMMENTS[key]}"
        for name_in in table.__struct_fields__:
            if (value := getattr(table, name_in)) is not None:
                text += f"\n{name_in} = {json.dumps(value)}"
    return text + "\n"
