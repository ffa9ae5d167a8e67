"""The double on virtual time: its frames are handed over in memory."""

from collections import deque
from collections.abc import Callable

from services.ardusub.io.codec import BoardCodec, FrameReader
from services.ardusub.io.link import BoardLink
from services.ardusub.packet import MavlinkPacket
from services.runtime.hosts.virtual_host import VirtualHost
from tools.research.ardusub_double.board import BoardDouble

SERVICE = "ardusub"  # it is told of arrivals as long as it runs
STEP_HZ = 400.0  # [1/s] twice the board's own rate


class MemoryLink(BoardLink):
    """The service's end of the cable. It can be cut, and bytes can be put into it."""

    def __init__(self) -> None:
        self.up, self.down = deque[bytes](), deque[bytes]()
        self.cut = False
        self.notify: Callable[[], None] = lambda: None

    @property
    def trouble(self) -> str:
        return ""

    def start(self, notify: Callable[[], None]) -> None:
        self.notify = notify

    def receive(self) -> list[bytes]:
        found = list(self.up)
        self.up.clear()
        return [] if self.cut else found

    def send(self, data: bytes) -> None:
        if not self.cut:
            self.down.append(data)

    def lost(self) -> tuple[int, int]:
        return 0, 0

    def close(self) -> None:
        self.cut = True


class BoardOnHost:
    """A board stepped by a virtual host, and another ground station at the same board."""

    def __init__(self, host: VirtualHost, board: BoardDouble) -> None:
        self.board, self.link, self._host = board, MemoryLink(), host
        self.heard: list[MavlinkPacket] = []  # from the service
        self.alive = True
        self._codec = BoardCodec(board.system, 1)
        self._reader = FrameReader(self._codec)
        node = host.node("board", ["drone"])
        node.every(STEP_HZ, self.step)

    def other_station(self, packet: MavlinkPacket, now: int) -> None:
        """A packet of another ground station."""
        self.board.hear(packet._replace(system=packet.system or 254, component=190), now)

    def step(self, now: int) -> None:
        while self.link.down:
            for packet in self._reader.read(self.link.down.popleft()).packets:
                self.heard.append(packet)
                if self.alive:
                    self.board.hear(packet, now)
        if not self.alive:
            return
        self.board.advance(now)
        for packet in self.board.sent():
            self.link.up.append(self._codec.encode(packet))
        if self.link.up and not self.link.cut and SERVICE in self._host.nodes:
            self.link.notify()
