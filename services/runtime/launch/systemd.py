"""What systemd is told of a side that it has started (Type=notify): that it is ready, works, or
ends. The protocol is that of sd_notify(3): a datagram of text to a unix socket.

Without systemd there is no `NOTIFY_SOCKET`, and nobody is told anything.
"""

import socket
import sys
from collections.abc import Mapping
from contextlib import suppress

SOCKET, PERIOD, PROCESS = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"


class Systemd:
    """Nothing here raises or waits, whatever has become of systemd."""

    def __init__(self, environment: Mapping[str, str], pid: int) -> None:
        """
        Args:
            pid: of this process; the watchdog may be meant for another one.
        """
        address = environment.get(SOCKET, "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        period_us = environment.get(PERIOD, "")
        watched = period_us.isdecimal() and environment.get(PROCESS, str(pid)) == str(pid)
        # Twice as often as it must be, as sd_watchdog_enabled(3) recommends; None: no watchdog.
        self._every_ns = int(period_us) * 1000 // 2 if watched else None
        self._due = 0  # [ns] next sign of life

    def ready(self) -> None:
        """Everything has started."""
        self._send("READY=1")

    def stopping(self) -> None:
        """The end was asked for."""
        self._send("STOPPING=1")

    def works(self, now: int) -> None:
        """Every process answers at `now` [ns]. Call it often. If it is not called for the time of
        the watchdog, systemd ends the whole side and starts it again."""
        if self._every_ns is not None and now >= self._due:
            self._due = now + self._every_ns
            self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        if not self._address or sys.platform == "win32":
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            sender.sendto(text.encode(), self._address)
