"""Bytes to and from the board, by URL. Nothing here waits, but for the thread that notifies.

udpin:HOST:PORT       wait there for the board, as BlueOS's "UDP Client" endpoint wants it
udpout:HOST:PORT      speak first
tcp:HOST:PORT         connect, and connect again when it is lost
serial:DEVICE:BAUD    a cable
"""

import contextlib
import errno
import os
import socket
import termios
import time
from collections.abc import Callable
from typing import Protocol

from services.ardusub.io.watch import ArrivalWatch
from services.runtime.config.errors import LindyError

ALLOWED = "udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"
DATAGRAMS = 64  # read at once; more wait in the system's buffer
LONGEST = 4096  # [bytes] read at once
SILENT_S = 3.0  # [s] after which another sender may take the place of the board
AGAIN_S = 1.0  # [s] between two attempts to connect


class BoardLink(Protocol):
    @property
    def trouble(self) -> str:
        """Why there was no connection at the last attempt; empty where nothing is known."""
        ...

    def start(self, notify: Callable[[], None]) -> None:
        """`notify` is called when something has arrived; `receive` then takes it. A connection
        that is lost is made again by `receive` alone, so that it is called now and then anyway."""
        ...

    def receive(self) -> list[bytes]: ...

    def send(self, data: bytes) -> None: ...

    def lost(self) -> tuple[int, int]:
        """Datagrams of others than the board, and packets that could not be sent, since the last
        call."""
        ...

    def close(self) -> None: ...


def open_link(url: str) -> BoardLink:
    """
    Raises:
        LindyError: the URL is none of those above, or the port cannot be opened.
    """
    kind, _, rest = url.partition(":")
    where, _, number = rest.rpartition(":")
    if kind not in ("udpin", "udpout", "tcp", "serial") or not where or not number.isdecimal():
        raise LindyError(f"ardusub.url: found {url!r}; allowed: {ALLOWED}")
    try:
        if kind == "serial":
            return SerialLink(where, int(number))
        address = socket.gethostbyname(where), int(number)
        if kind == "tcp":
            return TcpLink(address)
        return UdpLink(address, listens=kind == "udpin")
    except (OSError, OverflowError, termios.error) as error:
        if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
            raise LindyError(
                f"ardusub.url {url}: another program has this port, perhaps another dive, `lindy "
                f"doctor` or a ground station; end it, or send the board's packets to another port"
            ) from None
        if isinstance(error, FileNotFoundError | PermissionError):
            raise LindyError(f"ardusub.url {url}: {error.strerror}") from None
        raise LindyError(f"ardusub.url {url}: {error}; allowed: {ALLOWED}") from None


class _Link:
    """Says when something arrives, and counts what could not be done."""

    def __init__(self) -> None:
        self.strangers = self.unsent = 0
        self.trouble = ""
        self._watch: ArrivalWatch | None = None

    def descriptor(self) -> int:
        """Of the socket or file; -1 where there is none."""
        raise NotImplementedError

    def start(self, notify: Callable[[], None]) -> None:
        self._watch = ArrivalWatch(self.descriptor, notify)

    def _stop(self) -> None:
        if self._watch is not None:
            self._watch.close()
            self._watch = None

    def lost(self) -> tuple[int, int]:
        found = self.strangers, self.unsent
        self.strangers = self.unsent = 0
        return found


class UdpLink(_Link):
    """One board: datagrams of other senders are left alone as long as it speaks."""

    def __init__(self, address: tuple[str, int], *, listens: bool) -> None:
        super().__init__()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._peer: tuple[str, int] | None = None if listens else address
        self._fixed, self._heard = not listens, -SILENT_S
        try:
            if listens:
                self._socket.bind(address)
        except (OSError, OverflowError):
            self._socket.close()
            raise

    def descriptor(self) -> int:
        return self._socket.fileno()

    def receive(self) -> list[bytes]:
        found: list[bytes] = []
        for _ in range(DATAGRAMS):
            try:
                data, sender = self._socket.recvfrom(LONGEST)
            except OSError:  # nothing more, or nobody listens there yet
                break
            if self._is_board(sender):
                found.append(data)
            else:
                self.strangers += 1
        return found

    def _is_board(self, sender: tuple[str, int]) -> bool:
        now = time.monotonic()
        if self._fixed:
            return sender == self._peer
        if sender != self._peer and now - self._heard < SILENT_S:
            return False
        self._peer, self._heard = sender, now
        return True

    def send(self, data: bytes) -> None:
        if self._peer is None:
            return
        try:
            self._socket.sendto(data, self._peer)
        except OSError:
            self.unsent += 1

    def close(self) -> None:
        self._stop()
        self._socket.close()


class TcpLink(_Link):
    def __init__(self, address: tuple[str, int]) -> None:
        """The first connection may be refused: the board may not be up yet."""
        super().__init__()
        self._address = address
        self._socket: socket.socket | None = None
        self._again = 0.0
        self._connect()

    def _connect(self) -> None:
        self._again, self._refused = time.monotonic() + AGAIN_S, ""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.connect_ex(self._address)

    def descriptor(self) -> int:
        connection = self._socket  # the other thread may take it away
        return -1 if connection is None else connection.fileno()

    def receive(self) -> list[bytes]:
        if self._socket is None:
            if time.monotonic() >= self._again:
                self._connect()
            return []
        try:
            data = self._socket.recv(LONGEST)
        except BlockingIOError:
            return []
        except ConnectionResetError:
            data = b""
        except OSError as error:
            self._refused, data = self._refused or error.strerror or str(error), b""
        if data:
            self.trouble = ""
            return [data]
        self.trouble = self._refused or "closed by the other side"
        self._disconnect()
        return []

    def send(self, data: bytes) -> None:
        try:
            sent = 0 if self._socket is None else self._socket.send(data)
        except OSError as error:  # not connected yet, or no room
            sent = 0
            if isinstance(error, ConnectionRefusedError):
                self._refused = error.strerror or str(error)  # the system says it only once
        if 0 < sent < len(data):  # the rest of a frame must not follow later
            self._disconnect()
        self.unsent += sent < len(data)

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        self._stop()
        self._disconnect()


class SerialLink(_Link):
    def __init__(self, device: str, baud: int) -> None:
        """
        Raises:
            OSError: there is no such device.
        """
        super().__init__()
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise OSError(f"{baud} is no speed of this system, such as 115200")
        self._file = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            self._set(speed)
        except (OSError, termios.error):
            os.close(self._file)
            raise

    def _set(self, speed: int) -> None:
        """Eight bits as they come, nothing interpreted."""
        mode = termios.tcgetattr(self._file)
        mode[0] = mode[1] = mode[3] = 0
        mode[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        mode[4] = mode[5] = speed
        termios.tcsetattr(self._file, termios.TCSANOW, mode)
        termios.tcflush(self._file, termios.TCIOFLUSH)

    def descriptor(self) -> int:
        return self._file

    def receive(self) -> list[bytes]:
        with contextlib.suppress(OSError):  # nothing there, or the cable was pulled
            data = os.read(self._file, LONGEST)
            return [data] if data else []
        return []

    def send(self, data: bytes) -> None:
        try:
            self.unsent += os.write(self._file, data) < len(data)
        except OSError:
            self.unsent += 1

    def close(self) -> None:
        self._stop()
        os.close(self._file)
