"""A pad profile as a TOML file. Pure."""

import json

from services.gamepad.core import PadProfile

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
