"""What a stack can be on this machine: with the pilot's page in the browser (`--cockpit`), with a
service for each camera, without a picture or viewer where a library or camera is missing."""

import os
import secrets
import socket
import threading
import time
import webbrowser
from collections.abc import Collection
from contextlib import suppress
from importlib.util import find_spec

import msgspec

from services.camera.core import FURTHER, SIMULATED
from services.camera.core import Settings as CameraSettings
from services.cockpit.core import Settings
from services.cockpit.io.access import VARIABLE, access_to, listening
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.choices import Choices
from tools.live.pilots import GAMEPAD

COCKPIT = "cockpit"  # its name as a service, and of the stack that it is taken from
CAMERA = "camera"  # service of the picture
SIMULATOR = "simulator"  # what a simulated camera films
VIEWER = "visualizer"
PATIENCE_S = 20.0  # [s] for the service to listen
LOOK_S = 0.1  # [s]


def runnable(services: Registry) -> Registry:
    """The services that can run here. Without rerun there is no visualizer, which is printed."""
    if VIEWER not in services or find_spec("rerun") is not None:
        return services
    print(
        "rerun is not installed, so this dive has no viewer and no dive.rrd; "
        f"{how_to_install('viewer')}",
        flush=True,
    )
    return services.only({name: spec for name, spec in services.items() if name != VIEWER})


def with_cockpit(services: Registry, pilot: str | None) -> Registry:
    """The stack with a cockpit, in place of the gamepad or beside the pilot that was chosen, and
    with the camera."""
    shipped = Registry.read(COCKPIT)
    leaves = {GAMEPAD} if pilot is None and COCKPIT not in services else set[str]()
    kept = {name: spec for name, spec in services.items() if name not in leaves}
    added = {name: shipped[name] for name in (COCKPIT, CAMERA) if name not in services}
    return services.only({**kept, **added})


def with_picture(services: Registry, choices: Choices, every: Collection[str] = ()) -> Registry:
    """A stack with a cockpit as it can run here. Without PyAV it has no camera, and none where the
    vehicle file names no camera and there is no simulator to be filmed; either is printed.

    Args:
        every: where these are those of one side, all services of the stack.

    Raises:
        LindyError: the table [camera] is wrong.
    """
    if COCKPIT not in {*services, *every} or CAMERA not in services:
        return services
    stack = Stack(vehicle=choices.vehicle, overrides=list(choices.set_))
    if find_spec("av") is None:
        why = f"PyAV is not installed, so this dive has no picture; {how_to_install('camera')}"
    elif (
        SIMULATOR in {*services, *every}
        or stack.section("camera", CameraSettings).source != SIMULATED
    ):
        return services
    else:
        why = "no camera is named, so this dive has no picture: --set camera.source=/dev/video0"
    print(why, flush=True)
    return services.only({name: spec for name, spec in services.items() if name != CAMERA})


def with_further_cameras(services: Registry, choices: Choices) -> Registry:
    """A stack with a camera, with a service of its own for each further camera of the vehicle file:
    one that hangs takes no other along.

    Raises:
        LindyError: the table [camera] is wrong.
    """
    first = services.get(CAMERA)
    if first is None:
        return services
    stack = Stack(vehicle=choices.vehicle, overrides=list(choices.set_))
    names = [f"{FURTHER}{name}" for name in stack.section(CAMERA, CameraSettings).more]
    further = {name: msgspec.structs.replace(first, service=CAMERA, process=name) for name in names}
    return services.only({**further, **services})


def announce(stack: Stack, *, browser: bool) -> None:
    """Print where the page is, and open it once it is there.

    Raises:
        LindyError: it cannot be there.
    """
    settings = stack.section(COCKPIT, Settings)
    listening(settings).close()
    if not settings.local:  # the service gets it from here, so that the address can be printed
        os.environ.setdefault(VARIABLE, secrets.token_urlsafe(16))
    access = access_to(settings)
    print(f"cockpit: {access.pilot_url}", flush=True)
    if not settings.local:
        print(f"cockpit, to watch only: {access.watch_url}", flush=True)
    if browser:
        opening = (access.pilot_url, settings.host, settings.port)
        threading.Thread(target=_open_when_there, args=opening, daemon=True).start()


def _open_when_there(url: str, host: str, port: int) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        with suppress(OSError), socket.create_connection((host, port), timeout=1.0):
            webbrowser.open(url)
            return
        time.sleep(LOOK_S)
