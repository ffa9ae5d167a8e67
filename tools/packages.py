"""What this machine lacks for a dive: said before anything is started or written."""

from collections.abc import Collection
from importlib.util import find_spec

from services.gamepad.io.sdl import has_display
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install

PACKAGES = {
    "ardusub": ("pymavlink", "mavlink"),
    "mavlink": ("pymavlink", "mavlink"),
    "cockpit": ("websockets", "cockpit"),
    "foxglove": ("foxglove", "foxglove"),
    "ros2": ("rosbags", "ros2"),
    "camera": ("av", "camera"),
}  # service → what it imports, and the extra that installs it
HANDS = ("gamepad", "keyboard")  # pilots whose sticks pygame reads
SCRIPT = "use --pilot script:FILE"


def require_package(package: str, extra: str, what: str) -> None:
    """
    Args:
        extra: that installs it.
        what: needs it, for the message.

    Raises:
        LindyError: it is not installed.
    """
    if find_spec(package) is None:
        raise LindyError(f"{what} needs {package}, which is not installed; {how_to_install(extra)}")


def lacking(services: Collection[str], pilot: str = "") -> str | None:
    """Why these services with this pilot cannot run here; None: they can."""
    for service in services:
        package, extra = PACKAGES.get(service, ("", ""))
        if package and find_spec(package) is None:
            return f"{service} needs {package}, which is missing: {how_to_install(extra)}"
    if "gamepad" not in services or pilot not in HANDS:
        return None
    if find_spec("pygame") is None:
        return f"pads and the keyboard need pygame: {how_to_install('pilot')}; or {SCRIPT}"
    if pilot == "keyboard" and not has_display():
        return f"--pilot keyboard needs a window, and there is no display here; {SCRIPT}"
    return None
