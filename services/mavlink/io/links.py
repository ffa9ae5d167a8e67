"""Links to ground stations over UDP and TCP.

A thread of its own waits for the sockets and keeps what arrives; the service's thread takes it, and
sends. Nothing here waits for a ground station: what cannot be sent at once is dropped and counted.
"""

import selectors
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable

from services.mavlink.io.codec import Codec
from services.mavlink.packets import Addressed, ReceivedPacket
from services.runtime.config.errors import LindyError

MOST_PEERS = 16  # ground stations at once
READ = 2048  # [B] of a stream that are read at once; no datagram is longer
DATAGRAMS = 16  # that are read at once
FLOOD_PAUSE_S = 0.02  # [s] after more than that: 100 kB/s on a link, far beyond what anybody needs
UNREAD = 32_768  # [B] that a ground station has not read: some seconds of telemetry
KEPT = 65_536  # [B] of a link that wait for the service at most
SILENT_S = 60.0  # [s] after which a sender of datagrams is forgotten
Address = tuple[str, int]


class Peer:
    """One ground station's end, as far as a link can tell."""

    def __init__(self, sock: socket.socket, to: Address | None, codec: Codec) -> None:
        """`to`: for datagrams of a socket that is not connected."""
        self.socket = sock
        self.codec = codec
        self.whole = sock.type == socket.SOCK_DGRAM
        self.heard_s = time.monotonic()
        self.waiting: deque[bytes] = deque()
        self._to = to
        self._rest = b""  # of a frame that was begun

    def put(self, frame: bytes) -> None:
        """Send it whole or not at all.

        Raises:
            OSError: it could not be sent.
        """
        if self._to is not None:
            self.socket.sendto(frame, self._to)
            return
        if self._rest:  # half a frame would spoil all that follow
            self._rest = self._rest[self.socket.send(self._rest) :]
            if self._rest:
                raise BlockingIOError
        self._rest = frame[self.socket.send(frame) :]

    @property
    def may_be_forgotten(self) -> bool:
        """A sender of datagrams that was silent for long: nobody says when one has gone."""
        return self._to is not None and time.monotonic() > self.heard_s + SILENT_S


class Links:
    """All links of the service. `counts` is taken and cleared by the service."""

    def __init__(self, urls: Iterable[str], system: int) -> None:
        """
        Raises:
            LindyError: an address is no good, or taken.
        """
        self.counts: Counter[str] = Counter()
        self._system = system
        self._peers: dict[str, Peer] = {}
        self._lock = threading.Lock()  # of the peers
        self._selector = selectors.DefaultSelector()
        self._closing, self._closed = socket.socketpair()
        self._selector.register(self._closed, selectors.EVENT_READ, None)
        self._thread: threading.Thread | None = None
        try:
            for url in urls:
                self._open(url)
        except LindyError:
            self.close()
            raise

    def start(self, notify: Callable[[], None]) -> None:
        """Begin to read; `notify` is called when something has arrived."""
        self._thread = threading.Thread(target=self._read, args=(notify,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.send(b".")
        if self._thread is not None:
            self._thread.join(1.0)
        for key in list(self._selector.get_map().values()):
            assert isinstance(key.fileobj, socket.socket)
            key.fileobj.close()
        self._closing.close()

    @property
    def names(self) -> list[str]:
        with self._lock:
            return list(self._peers)

    def received(self) -> list[ReceivedPacket]:
        """Everything that has arrived since."""
        return [
            packet
            for peer in self._all()
            for _ in range(len(peer.waiting))
            for packet in peer.codec.decode(peer.waiting.popleft(), whole=peer.whole)
        ]

    def send(self, addressed: Addressed) -> None:
        with self._lock:
            peers = [p for n, p in self._peers.items() if addressed.link in (None, n)]
        for peer in peers:
            if (frame := peer.codec.encode(addressed.packet)) is None:
                continue
            try:
                peer.put(frame)
            except ConnectionRefusedError:
                pass  # nobody listens there yet
            except OSError:
                self.counts["dropped:mavlink"] += 1

    # Opening.

    def _open(self, url: str) -> None:
        kind, host, port = url.split(":")
        address = (host, int(port))
        stream = kind == "tcpin"
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM if stream else socket.SOCK_DGRAM)
        self._selector.register(sock, selectors.EVENT_READ, kind)
        sock.setblocking(False)
        try:
            if kind == "udpout":
                sock.connect(address)
                self._add(f"udp {host}:{port}", sock)
                return
            if stream:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind(address)
            if stream:
                sock.listen()
        except OSError as error:
            raise LindyError(f"mavlink.links: {url} cannot be opened: {error}") from None

    def _add(self, name: str, sock: socket.socket, to: Address | None = None) -> Peer | None:
        """None, and counted: there are too many already."""
        with self._lock:
            for other, peer in list(self._peers.items()):
                if peer.may_be_forgotten:
                    del self._peers[other]
            if len(self._peers) >= MOST_PEERS:
                self.counts["too_many:mavlink"] += 1
                return None
            peer = self._peers[name] = Peer(sock, to, Codec(name, self._system, self.counts))
            return peer

    # Reading, on the thread of its own.

    def _read(self, notify: Callable[[], None]) -> None:
        while True:
            full = False
            for key, _ in self._selector.select():
                if key.data is None:
                    return
                assert isinstance(key.fileobj, socket.socket)
                full = self._read_from(key.fileobj, key.data) or full
            notify()
            if full:
                time.sleep(FLOOD_PAUSE_S)  # a flood must not take the processor

    def _read_from(self, sock: socket.socket, kind: str) -> bool:
        """Whether there may be more."""
        try:
            if kind == "tcpin":
                self._accept(sock)
                return False
            if kind == "stream":
                return self._read_stream(sock)
            return self._read_datagrams(sock, kind)
        except (BlockingIOError, ConnectionRefusedError):
            return False
        except OSError:
            if kind == "stream":
                self._drop(sock)
            return False

    def _accept(self, sock: socket.socket) -> None:
        connection, (host, port) = sock.accept()
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD)
        if self._add(f"tcp {host}:{port}", connection) is None:
            connection.close()
        else:
            self._selector.register(connection, selectors.EVENT_READ, "stream")

    def _read_stream(self, sock: socket.socket) -> bool:
        data = sock.recv(READ)
        if data:
            self._keep(next((p for p in self._all() if p.socket is sock), None), data)
        else:
            self._drop(sock)
        return len(data) == READ

    def _read_datagrams(self, sock: socket.socket, kind: str) -> bool:
        for _ in range(DATAGRAMS):
            data, (host, port) = sock.recvfrom(READ)
            name = f"udp {host}:{port}"
            peer = self._peers.get(name)
            if peer is None and kind == "udpin":
                peer = self._add(name, sock, (host, port))
            self._keep(peer, data)
        return True

    def _all(self) -> list[Peer]:
        with self._lock:
            return list(self._peers.values())

    def _keep(self, peer: Peer | None, data: bytes) -> None:
        if peer is None:
            return
        peer.heard_s = time.monotonic()
        if sum(map(len, peer.waiting)) + len(data) > KEPT:
            self.counts["overflowed:mavlink"] += 1
        else:
            peer.waiting.append(data)

    def _drop(self, sock: socket.socket) -> None:
        """The other end is gone."""
        self._selector.unregister(sock)
        with self._lock:
            for name, peer in list(self._peers.items()):
                if peer.socket is sock:
                    del self._peers[name]
        sock.close()
