"""Which key does what: one table, for the page in a browser and for the keyboard's window.

Keys are named by their place on the keyboard, as in `KeyboardEvent.code` of the W3C, so W A S D are
under the same fingers on every layout. None is Ctrl, Alt or Meta, nor acts while one of them is
down: with them browsers and systems have commands of their own, and Ctrl+W closes the page.
"""

from typing import Literal, NamedTuple

Kind = Literal["steer", "tool", "press", "hold", "page"]


class Key(NamedTuple):
    """What keys do."""

    action: str
    codes: tuple[str, ...]  # any of them
    sentence: str
    # steer: while it is down; tool: the same, beside whatever steers; press: once; hold: after a
    # second; page: once, and only the page has it
    kind: Kind = "steer"


KEYS = (
    Key("ahead", ("KeyW",), "forward"),
    Key("back", ("KeyS",), "back"),
    Key("port", ("KeyA",), "port"),
    Key("starboard", ("KeyD",), "starboard"),
    Key("rise", ("ArrowUp",), "rise"),
    Key("sink", ("ArrowDown",), "sink"),
    Key("turn_port", ("ArrowLeft",), "turn to port"),
    Key("turn_starboard", ("ArrowRight",), "turn to starboard"),
    Key("tilt_up", ("KeyR",), "camera up"),
    Key("tilt_down", ("KeyF",), "camera down"),
    Key("boost", ("ShiftLeft", "ShiftRight"), "boost"),
    Key("slow", ("KeyC",), "slow"),
    Key("stop", ("Space",), "STOP", "press"),
    Key("arm", ("Enter",), "arm or resume", "hold"),
    Key("disarm", ("Backspace",), "disarm", "hold"),
    Key("light", ("KeyL",), "light on, off", "press"),
    Key("light_2", ("KeyJ",), "second light on, off", "press"),
    Key("laser", ("KeyI",), "lasers or first switch on, off", "press"),
    Key("gripper_open", ("KeyG",), "open the gripper", "tool"),
    Key("gripper_close", ("KeyB",), "close the gripper", "tool"),
    Key("brighter", ("KeyO",), "light one step up", "page"),
    Key("darker", ("KeyK",), "light one step down", "page"),
    Key("deeper", ("PageDown",), "half a metre deeper", "page"),
    Key("shallower", ("PageUp",), "half a metre up", "page"),
    Key("heading_port", ("KeyQ",), "10° to port", "page"),
    Key("heading_starboard", ("KeyE",), "10° to starboard", "page"),
    Key("speed", ("KeyX",), "speed limit: 25, 50, 75, 100 %", "page"),
    Key("film", ("KeyV",), "record a film", "page"),
    Key("snapshot", ("KeyP",), "take a snapshot", "page"),
    Key("map", ("KeyN",), "map", "page"),
    Key("next_camera", ("KeyT",), "make the next camera the large one", "page"),
    Key("mute", ("KeyM",), "sound off, on", "page"),
)
HOLD_NS = 1_000_000_000  # [ns] what is deliberate is held for so long
