"""Opens the stick source that `--pilot` names."""

from pathlib import Path

from services.gamepad.core import PadProfile, Settings, StickSource
from services.gamepad.io import sdl
from services.gamepad.io.path_file import course_named
from services.gamepad.stick_log import Player, StickLog, parse
from services.piloting.sticks import CENTRED
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file, read, read_whole
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node


def open_source(node: Node, stack: Stack, played: int) -> StickSource:
    """Opens the pad, the keyboard's window or the script.

    Raises:
        LindyError: an unknown word, a malformed file, no pygame, or no display for the keyboard.
    """
    word, _, name = stack.pilot.partition(":")
    if word == "script" and name:
        script = read_script(name)
        last = script.rows[-1]
        if last.sticks != CENTRED or last.event == "lost":
            text = f"script {name}: the last row is its end, so its sticks move nothing"
            node.log("warning", text)
        return Player(Path(name).stem, script, node.outbox, played)
    if stack.pilot not in ("gamepad", "keyboard"):
        raise LindyError(f"--pilot {stack.pilot}: expected gamepad, keyboard or script:FILE")
    sdl.load()
    from services.gamepad.io.keyboard import Keyboard  # here: a script needs no pygame
    from services.gamepad.io.pad import Pad

    profile = pad_profile(stack)
    is_pad = stack.pilot == "gamepad"
    source = Pad(profile, node.outbox) if is_pad else Keyboard(profile.gain, node.outbox)
    node.on_close(source.close)
    return source


def read_script(name: str) -> StickLog:
    """A dive of deploy/dives by name, or a stick log by its path ending in .csv.

    Raises:
        LindyError: there is no such file, or a line of it is wrong.
    """
    path = deploy_file("dives", name, ".csv")
    try:
        return parse(read_whole(path), course_named)
    except ValueError as error:
        raise LindyError(f"{path}: {error}") from None


def pad_profile(stack: Stack) -> PadProfile:
    """
    Raises:
        LindyError: there is no such profile, or a mistake in it.
    """
    name = stack.section("gamepad", Settings).profile
    return read(deploy_file("pads", name), PadProfile)
