"""Whoever closes a TCP connection of this process is not kept waiting until the other end has all
that was sent: Linux goes on trying by itself. Zenoh cannot be told so, its descriptors can.
"""

import os
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

DESCRIPTORS = "/proc/self/fd"
NETWORKS = (socket.AF_INET, socket.AF_INET6)


class Ends(NamedTuple):
    """Of a connection: `host:port` of this end and of the other."""

    here: str
    there: str


def close_without_waiting(wanted: Ends) -> None:
    """Of this connection (SO_LINGER off)."""
    for number in _sockets():
        with suppress(OSError), socket.socket(fileno=os.dup(number)) as link:
            if _ends(link) == wanted:
                link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 0, 0))


def ends_of(source: str, destination: str) -> Ends:
    """
    Args:
        source, destination: as Zenoh writes them, such as `tls/127.0.0.1:7447`.
    """
    return Ends(source.partition("/")[2], destination.partition("/")[2])


def _sockets() -> Iterator[int]:
    """Descriptor of every socket of this process."""
    try:
        numbers = os.listdir(DESCRIPTORS)  # noqa: PTH208 - names alone
    except OSError:  # not Linux, or no descriptors are left
        return
    for number in map(int, numbers):
        with suppress(OSError):  # it was closed meanwhile
            if stat.S_ISSOCK(os.fstat(number).st_mode):
                yield number


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
