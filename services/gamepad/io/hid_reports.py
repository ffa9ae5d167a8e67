"""A pad's raw reports on Linux, as the sign that it still answers.

The kernel gives every reader of a hidraw device its own copy, so nothing is taken from SDL. Where
there is no such device, more than one that could be meant, or no permission to read it, no report
ever arrives.
"""

import os
import sys
from contextlib import suppress
from pathlib import Path

REPORT = 4096  # [bytes] longest report
MOST = 64  # reports that the kernel keeps for a reader
SYSTEM, DEVICES = Path("/sys/class/hidraw"), Path("/dev")


class HidReports:
    """Of the pad with an SDL joystick GUID."""

    def __init__(self, guid: str, system: Path = SYSTEM, devices: Path = DEVICES) -> None:
        self._file: int | None = None
        wanted = product_of(guid)
        found = [node for node in _nodes(system) if wanted and _product(node) == wanted]
        if sys.platform == "linux" and len(found) == 1:
            with suppress(OSError):
                self._file = os.open(devices / found[0].name, os.O_RDONLY | os.O_NONBLOCK)

    def arrived(self) -> bool:
        """Has a report arrived since the last call?"""
        if self._file is None:
            return False
        arrived = False
        try:
            for _ in range(MOST):
                if not os.read(self._file, REPORT):
                    break
                arrived = True
        except BlockingIOError:
            pass
        except OSError:  # unplugged
            self.close()
        return arrived

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None


def product_of(guid: str) -> tuple[int, int] | None:
    """USB or Bluetooth ids of vendor and product; None: the GUID has none."""
    try:
        data = bytes.fromhex(guid)
    except ValueError:
        return None
    if len(data) != 16:
        return None
    vendor, product = (int.from_bytes(data[at : at + 2], "little") for at in (4, 8))
    return (vendor, product) if vendor and product else None


def _nodes(system: Path) -> list[Path]:
    try:
        return sorted(system.iterdir())
    except OSError:
        return []


def _product(node: Path) -> tuple[int, int] | None:
    """As the kernel has it: `HID_ID=0005:0000054C:000009CC`."""
    with suppress(OSError, ValueError):
        for line in (node / "device" / "uevent").read_text().splitlines():
            if line.startswith("HID_ID="):
                _, vendor, product = line.removeprefix("HID_ID=").split(":")
                return int(vendor, 16), int(product, 16)
    return None
