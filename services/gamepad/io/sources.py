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
        return _open_script(node, name, played)
    if stack.pilot == "gamepad":
        return _open_pad(node, stack)
    if stack.pilot == "keyboard":
        return _open_keyboard(node, stack)
    raise LindyError(f"--pilot {stack.pilot}: expected gamepad, keyboard or script:FILE")


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


def _open_script(node: Node, name: str, played: int) -> Player:
    script = read_script(name)
    last = script.rows[-1]
    if last.sticks != CENTRED or last.event == "lost":
        node.log("warning", f"script {name}: the last row is its end, so its sticks move nothing")
    return Player(Path(name).stem, script, node.outbox, played)


def _open_pad(node: Node, stack: Stack) -> StickSource:
    sdl.load()
    from services.gamepad.io.pad import Pad  # here: a script needs no pygame

    pad = Pad(pad_profile(stack), node.outbox)
    node.on_close(pad.close)
    return pad


def _open_keyboard(node: Node, stack: Stack) -> StickSource:
    sdl.load()
    from services.gamepad.io.keyboard import Keyboard

    keyboard = Keyboard(pad_profile(stack).gain, node.outbox)
    node.on_close(keyboard.close)
    return keyboard


def pad_profile(stack: Stack) -> PadProfile:
    """
    Raises:
        LindyError: there is no such profile, or a mistake in it.
    """
    name = stack.section("gamepad", Settings).profile
    return read(deploy_file("pads", name), PadProfile)
