"""`lindy pad`: shows what a pad sends, and writes a profile for it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from services.gamepad.core import PadProfile
from services.gamepad.io import sdl
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file, read
from tools.choices import UntilCtrlC, named
from tools.fresh import refuse_existing, write_fresh
from tools.pad.teaching import toml_of


def pad(
    *,
    profile: Annotated[
        str, Parameter(help="a name in deploy/pads, or the path of a TOML file")
    ] = "default",
    write: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="ask for each action in turn, and write a profile into this new file",
        ),
    ] = None,
    seconds: UntilCtrlC = None,
) -> int:
    """Show what a pad sends, and write a profile for it.

    It shows sticks, triggers and buttons in SDL's names, how often they
    change, and what the profile makes of them, until Ctrl-C.

    Example: lindy pad --write mine.toml
    """
    if seconds is not None and not seconds > 0.0:
        raise LindyError(f"--seconds is {seconds:g}, expected more than 0")
    base = read(deploy_file("pads", profile), PadProfile)
    if write is not None:
        refuse_existing(write, "--write")
    sdl.load()
    from tools.pad.device import Device  # here: it needs pygame
    from tools.pad.session import show, teach

    with Device() as device:
        if write is None:
            show(device, base, seconds)
            return 0
        taught = teach(device, base, seconds)
    write_fresh(write, toml_of(taught, device.name).encode(), "--write")
    print(f"{write}: fly with --set gamepad.profile={write}", flush=True)
    return 0
