"""Bytes to and from other ends, by URL. Nothing here waits, but for the thread that notifies.

udpin:HOST:PORT     wait there for datagrams, as BlueOS's "UDP Client" endpoint wants it
udpout:HOST:PORT    speak first
tcpin:HOST:PORT     wait there for connections
tcp:HOST:PORT       connect, and connect again when it is lost
serial:DEVICE:BAUD  a cable, opened again when it was pulled; the file of DEVICE may be a pattern
                    with *: the first that is there, whatever number it has come back under

What arrives waits in the system's buffers; what cannot be sent at once is dropped and counted.
"""

import errno
import os
import selectors
import socket
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from io import FileIO
from math import inf
from pathlib import Path
from typing import NamedTuple, Protocol

from messages import events
from messages.events import Event, Outbox
from services.runtime.config.errors import LindyError
from services.runtime.os import system

ALLOWED = "udpin:HOST:PORT, udpout:HOST:PORT, tcpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"
DATAGRAMS = 1024  # read at once: more than the system's buffer holds, so that the newest is read
READ = 65_536  # [bytes] of a connection, read at once
DATAGRAM = 4096  # [bytes] of the longest
UNREAD = 32_768  # [bytes] that the other end of a connection has not read: seconds of telemetry
AGAIN_S = 1.0  # [s] between two attempts to connect
PAUSE_S = 0.003  # [s] between two calls of `notify`
FLOOD = 32  # datagrams of a look; with more it must not take the processor, …
FLOOD_PAUSE_S = 0.01  # [s] … and the next look comes later; the buffer holds 200 of them and more
# No room, or not connected yet.
NOT_YET = (errno.EAGAIN, errno.EWOULDBLOCK, errno.ENOTCONN, errno.EINPROGRESS)
Address = tuple[str, int]
End = socket.socket | FileIO


class Received(NamedTuple):
    """What has arrived over one link since the last look."""

    link: str  # `tcp 127.0.0.1:40112`
    pieces: list[bytes]
    datagrams: bool = False


class FarEndLimits(NamedTuple):
    """How many other ends there may be."""

    most: int
    silent_s: float  # [s] after which a sender of datagrams makes room for another one
    beyond: Event  # of each datagram and connection of others
    dropped: Event = events.DROPPED_MAVLINK()  # of what the other end does not read
    patient: bool = False  # a cable that is not there yet is awaited


class ByteLinks(Protocol):
    """Links to other ends."""

    @property
    def names(self) -> list[str]:
        """Names of the other ends."""
        ...

    @property
    def trouble(self) -> str:
        """Why a connection failed last; empty where nothing is known."""
        ...

    def start(self, notify: Callable[[], None]) -> None:
        """`notify` is called when something has arrived; `receive` then takes it. A connection
        that is lost is made again by `receive` alone, so that it is called now and then anyway."""
        ...

    def receive(self) -> list[Received]: ...

    def send(self, link: str, frame: bytes) -> None: ...

    def close(self) -> None: ...


@dataclass(slots=True)
class _Peer:
    """One other end, as far as a link can tell."""

    end: End | None  # None: no connection at present
    to: Address | None = None  # of datagrams
    heard_s: float = 0.0  # datagrams of it; of one that was called, always
    connect: Callable[[], End] | None = None
    again_s: float = 0.0  # when to connect
    rest: bytes = b""  # of a frame that was begun

    def send(self, frame: bytes) -> None:
        """Whole, or not at all: half a frame would spoil all that follow.

        Raises:
            OSError: it was not sent.
        """
        if self.end is None:
            raise BlockingIOError(errno.ENOTCONN, "")
        if isinstance(self.end, socket.socket) and self.to is not None:
            self.end.sendto(frame, self.to)
            return
        if self.rest:
            self.rest = self.rest[_written(self.end, self.rest) :]
            if self.rest:
                raise BlockingIOError(errno.EAGAIN, "")
        self.rest = frame[_written(self.end, frame) :]


class Links:
    """All links of a service: one reads and sends, a thread of its own only waits."""

    def __init__(
        self, urls: Iterable[str], setting: str, limits: FarEndLimits, outbox: Outbox
    ) -> None:
        """
        Args:
            setting: where the URLs come from, for people.
            outbox: is told of what is lost.

        Raises:
            LindyError: a URL is none of those above, or cannot be opened.
        """
        self.trouble = ""
        self._limits, self._outbox = limits, outbox
        self._peers: dict[str, _Peer] = {}
        self._readers: dict[End, Callable[[], None]] = {}
        self._arrived: dict[str, Received] = {}
        self._floods = False  # by the last look, much was read
        self._selector = selectors.DefaultSelector()
        self._closing, self._closed = socket.socketpair()
        self._selector.register(self._closed, selectors.EVENT_READ)
        self._thread: threading.Thread | None = None
        try:
            for url in urls:
                self._open(url, setting)
        except LindyError:
            self.close()
            raise

    @property
    def names(self) -> list[str]:
        return list(self._peers)

    def start(self, notify: Callable[[], None]) -> None:
        self._thread = threading.Thread(
            target=self._wait, args=(notify,), name="mavlink", daemon=True
        )
        self._thread.start()

    def receive(self) -> list[Received]:
        self._floods = False
        for name, peer in self._peers.items():
            if peer.end is None and time.monotonic() >= peer.again_s:
                self._connect(name, peer)
        for read in list(self._readers.values()):
            read()
        found, self._arrived = self._arrived, {}
        return list(found.values())

    def send(self, link: str, frame: bytes) -> None:
        peer = self._peers.get(link)
        if peer is None:
            return
        try:
            peer.send(frame)
        except OSError as error:
            self._outbox.tell(self._limits.dropped)
            if peer.to is None and error.errno not in NOT_YET:
                self._lose(link, peer, error.strerror or str(error))

    def again(self, why: str) -> None:
        """Give up what is connected, and connect anew: nothing else notices that the other end has
        lost its power."""
        for name, peer in list(self._peers.items()):
            if peer.connect is not None and peer.end is not None:
                self._lose(name, peer, self.trouble or why)

    def close(self) -> None:
        """Not to be called by the one who is notified."""
        self._closing.send(b".")
        if self._thread is not None:
            self._thread.join(1.0)
        self._selector.close()
        for end in (*self._readers, self._closing, self._closed):
            end.close()

    # Opening.

    def _open(self, url: str, setting: str) -> None:
        kind, _, rest = url.partition(":")
        where, _, number = rest.rpartition(":")
        known = kind in ("udpin", "udpout", "tcpin", "tcp", "serial")
        if not (
            known and where and number.isdecimal() and (kind == "serial" or int(number) < 65536)
        ):
            raise LindyError(f"{setting}: found {url!r}; allowed: {ALLOWED}")
        try:
            if kind == "serial":
                cable = partial(_cable, where, int(number))
                self._call(f"serial {where}", cable, at_once=not self._limits.patient)
                return
            address = socket.gethostbyname(where), int(number)
            if kind == "tcp":
                self._call(f"tcp {where}:{number}", partial(_connection, address))
            elif kind == "tcpin":
                self._listen(address)
            else:
                self._datagrams(address, listens=kind == "udpin")
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise LindyError(
                    f"{setting} {url}: another program has this port, perhaps another dive, `lindy "
                    f"doctor` or a ground station; end it, or choose another port"
                ) from None
            if isinstance(error, socket.gaierror):
                raise LindyError(
                    f"{setting} {url}: no computer is known here by the name {where}; "
                    f"allowed: a name that is, or a number like 192.168.2.2"
                ) from None
            if isinstance(error, FileNotFoundError | PermissionError):
                raise LindyError(f"{setting} {url}: {error.strerror}") from None
            raise LindyError(f"{setting} {url}: {error}; allowed: {ALLOWED}") from None

    def _register(self, end: End, read: Callable[[], None]) -> None:
        self._readers[end] = read
        self._selector.register(end, selectors.EVENT_READ)

    def _call(self, name: str, connect: Callable[[], End], *, at_once: bool = False) -> None:
        """A connection may be refused at first: the board may not be up yet. A cable is there."""
        peer = self._peers[name] = _Peer(None, connect=connect)
        if at_once:
            self._connected(name, peer, connect())
        else:
            self._connect(name, peer)

    def _connect(self, name: str, peer: _Peer) -> None:
        assert peer.connect is not None
        try:
            self._connected(name, peer, peer.connect())
        except OSError as error:
            if error.errno is None:  # no such speed, as is known at once: that does not pass
                raise
            self._lose(name, peer, error.strerror or str(error))

    def _connected(self, name: str, peer: _Peer, end: End) -> None:
        peer.end = end
        self._register(end, partial(self._read, name, peer))

    def _listen(self, address: Address) -> None:
        listener = socket.create_server(address)  # with SO_REUSEADDR
        listener.setblocking(False)
        self._register(listener, partial(self._accept, listener))

    def _datagrams(self, address: Address, *, listens: bool) -> None:
        end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        end.setblocking(False)
        self._register(end, partial(self._read_datagrams, end, listens=listens))
        if listens:
            end.bind(address)
        else:
            self._peers[_name("udp", address)] = _Peer(end, address, inf)

    # Reading.

    def _has_room(self) -> bool:
        silent = time.monotonic() - self._limits.silent_s
        for name, peer in list(self._peers.items()):
            if peer.to is not None and peer.heard_s < silent:  # nobody says when one has gone
                del self._peers[name]
        return len(self._peers) < self._limits.most

    def _accept(self, listener: socket.socket) -> None:
        try:
            connection, address = listener.accept()
        except OSError:  # gone again
            return
        if not self._has_room():
            self._outbox.tell(self._limits.beyond)
            connection.close()
            return
        name = _name("tcp", address)
        self._peers[name] = peer = _Peer(None)
        self._connected(name, peer, _prepared(connection))

    def _read_datagrams(self, end: socket.socket, *, listens: bool) -> None:
        now = time.monotonic()
        for number in range(DATAGRAMS):
            try:
                data, sender = end.recvfrom(DATAGRAM)
            except OSError:  # nothing more, or nobody listens there yet
                return
            self._floods = self._floods or number > FLOOD
            name = _name("udp", sender)
            if name not in self._peers and not (listens and self._has_room()):
                self._outbox.tell(self._limits.beyond)
                continue
            peer = self._peers.setdefault(name, _Peer(end, sender))
            peer.heard_s = max(peer.heard_s, now)
            arrival = self._arrived.setdefault(name, Received(name, [], datagrams=True))
            arrival.pieces.append(data)

    def _read(self, name: str, peer: _Peer) -> None:
        """Read a connection or a cable."""
        assert peer.end is not None
        data, why = b"", "closed by the other side"
        try:
            data = _read(peer.end)
        except BlockingIOError:
            return
        except ConnectionResetError:
            pass
        except OSError as error:
            why = error.strerror or str(error)
        if not data:
            self._lose(name, peer, why)
            return
        self.trouble, self._floods = "", self._floods or len(data) == READ
        self._arrived[name] = Received(name, [data])

    def _lose(self, name: str, peer: _Peer, why: str) -> None:
        """A connection has ended, or there is none yet."""
        self.trouble = why
        if peer.end is not None:
            self._selector.unregister(peer.end)
            del self._readers[peer.end]
            peer.end.close()
        peer.end, peer.rest, peer.again_s = None, b"", time.monotonic() + AGAIN_S
        if peer.connect is None:
            del self._peers[name]

    # Waiting, on the thread of its own.

    def _wait(self, notify: Callable[[], None]) -> None:
        next_s = 0.0
        while True:
            ready = self._selector.select()
            if any(key.fileobj is self._closed for key, _ in ready):
                return
            if ready:
                if (early := next_s - time.monotonic()) > 0.0:
                    time.sleep(early)
                notify()
                next_s = time.monotonic() + (FLOOD_PAUSE_S if self._floods else PAUSE_S)


def _read(end: End) -> bytes:
    """
    Raises:
        OSError: there is nothing to read, or never will be.
    """
    if isinstance(end, socket.socket):  # which is not a file everywhere
        return end.recv(READ)
    return os.read(end.fileno(), READ)


def _written(end: End, data: bytes) -> int:
    """[bytes] that were taken.

    Raises:
        OSError: none.
    """
    if isinstance(end, socket.socket):
        return end.send(data)
    return os.write(end.fileno(), data)


def _name(kind: str, address: Address) -> str:
    return f"{kind} {address[0]}:{address[1]}"


def _prepared(connection: socket.socket) -> socket.socket:
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD)
    return connection


def _cable(device: str, baud: int) -> FileIO:
    """
    Raises:
        OSError: as `system.serial`.
    """
    path = Path(device)
    there = sorted(path.parent.glob(path.name)) if "*" in path.name else []
    return system.serial(str(there[0]) if there else device, baud)


def _connection(address: Address) -> socket.socket:
    """
    Raises:
        OSError: it was refused at once; later refusals are read from it.
    """
    connection = _prepared(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
    error = connection.connect_ex(address)
    if error not in (0, errno.EINPROGRESS, errno.EWOULDBLOCK):
        connection.close()
        raise OSError(error, os.strerror(error))
    return connection
