"""The TCP connections of this process, as the operating system counts them.

Zenoh can neither say how much a link has sent nor end one. Linux can: a connection's byte counter
is in TCP_INFO, and `shutdown` of one of its descriptors ends it for Zenoh as if the cable were cut.
Elsewhere nothing is known here, and nobody is cut off.
"""

import ctypes
import os
import socket
import stat
import struct
import sys
from collections.abc import Collection, Iterator
from contextlib import suppress
from typing import NamedTuple

DESCRIPTORS = "/proc/self/fd"
RECEIVED = 128  # place of tcpi_bytes_received in Linux's struct tcp_info
INFO_LENGTH = RECEIVED + 8
HOUR_S = 3600
ATTACH_FILTER = 26  # SO_ATTACH_FILTER of Linux, which Python does not name
TAKE_NOTHING = struct.pack("HBBI", 0x06, 0, 0, 0)  # such a filter's one instruction: return 0 bytes
NETWORKS = (socket.AF_INET, socket.AF_INET6)


class Ends(NamedTuple):
    """Of a connection: `host:port` of this end and of the other."""

    here: str
    there: str


class TcpLinks:
    """Those of this process. Which descriptor is whose is remembered: an attacker may have hundreds
    of links, and asking for the ends of each takes longer than all the rest."""

    def __init__(self) -> None:
        self._known: dict[int, Ends | None] = {}  # by the inode of the socket

    def received(self, wanted: Collection[Ends]) -> dict[Ends, int]:
        """[bytes] that have come on each of these links so far; of those that can be asked."""
        found: dict[Ends, int] = {}
        if sys.platform != "linux":
            return found
        for ends, link in self._of(wanted):
            with suppress(OSError, struct.error):
                info = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, INFO_LENGTH)
                found[ends] = struct.unpack_from("<Q", info, RECEIVED)[0]
        return found

    def close_without_waiting(self, links: Collection[Ends]) -> None:
        """Whoever closes these links is not kept waiting until the other end has all that was sent
        (SO_LINGER off): Linux goes on trying by itself."""
        for _, link in self._of(links):
            with suppress(OSError):
                link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 0, 0))

    def cut(self, unwanted: Collection[Ends]) -> None:
        """End these links."""
        for _, link in self._of(unwanted):
            with suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)

    def ignore(self, unwanted: Collection[Ends]) -> None:
        """Let the kernel drop what comes on these links from now on, as if the cable were cut in
        this direction: Zenoh ends them as dead after their lease, of a second for our own services.
        Who is cut is back within milliseconds, with a handshake."""
        instruction = ctypes.create_string_buffer(TAKE_NOTHING)
        program = struct.pack("@HP", 1, ctypes.addressof(instruction))
        for _, link in self._of(unwanted):
            with suppress(OSError):
                link.setsockopt(socket.SOL_SOCKET, ATTACH_FILTER, program)

    def _of(self, wanted: Collection[Ends]) -> Iterator[tuple[Ends, socket.socket]]:
        """Second descriptors of these links, closed behind the caller."""
        if not wanted:
            return
        known: dict[int, Ends | None] = {}
        for number, inode in _sockets():
            if inode in self._known:
                known[inode] = self._known[inode]
                if known[inode] not in wanted:
                    continue
            with suppress(OSError), socket.socket(fileno=os.dup(number)) as link:
                ends = known[inode] = _ends(link)  # asked again: the inode may be another one's now
                if ends is not None and ends in wanted:
                    yield ends, link
        self._known = known


def let_callers_speak_first() -> None:
    """A connection on which nobody says anything waits in the kernel, not at the hub: of those that
    do not get through TLS, a hub takes no more than ten a second, and no other one meanwhile."""
    if sys.platform != "linux":
        return
    for number, _ in _sockets():
        with suppress(OSError), socket.socket(fileno=os.dup(number)) as own:
            if own.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                own.setsockopt(socket.IPPROTO_TCP, socket.TCP_DEFER_ACCEPT, HOUR_S)


def ends_of(source: str, destination: str) -> Ends:
    """
    Args:
        source, destination: as Zenoh writes them, such as `tls/127.0.0.1:7447`.
    """
    return Ends(source.partition("/")[2], destination.partition("/")[2])


def _sockets() -> Iterator[tuple[int, int]]:
    """Descriptor and inode of every socket of this process."""
    try:
        numbers = os.listdir(DESCRIPTORS)  # noqa: PTH208 - twenty times a second
    except OSError:  # not Linux, or no descriptors are left
        return
    for number in map(int, numbers):
        with suppress(OSError):  # it was closed meanwhile
            found = os.fstat(number)
            if stat.S_ISSOCK(found.st_mode):
                yield number, found.st_ino


def _ends(link: socket.socket) -> Ends | None:
    if link.family not in NETWORKS or link.type != socket.SOCK_STREAM:
        return None
    try:
        return Ends(_written(link.getsockname()), _written(link.getpeername()))
    except OSError:  # it listens, or has ended
        return None


def _written(address: tuple[str | int, ...]) -> str:
    host, port = str(address[0]), address[1]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
