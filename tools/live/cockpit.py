"""`lindy dive --cockpit`: the pilot's page beside any stack, and in the browser."""

import os
import secrets
import socket
import threading
import time
import webbrowser
from contextlib import suppress

from services.cockpit.core import Settings
from services.cockpit.io.access import VARIABLE, access_to
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.live.piloted_dive import GAMEPAD

COCKPIT = "cockpit"  # its name as a service, and of the stack that it is taken from
PATIENCE_S = 20.0  # [s] for the service to listen
LOOK_S = 0.1  # [s]


def with_cockpit(services: Registry, pilot: str | None) -> Registry:
    """The stack with a cockpit: in place of the gamepad, or beside the pilot that was chosen."""
    if COCKPIT in services:
        return services
    added = Registry.read(COCKPIT)[COCKPIT]
    leaves = {GAMEPAD} if pilot is None else set[str]()
    kept = {name: spec for name, spec in services.items() if name not in leaves}
    return services.only({**kept, COCKPIT: added})


def announce(stack: Stack, *, browser: bool) -> None:
    """Print where the page is, and open it once it is there."""
    settings = stack.section(COCKPIT, Settings)
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
