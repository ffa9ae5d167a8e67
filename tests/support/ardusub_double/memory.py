"""The double on virtual time: its frames are handed over in memory."""

from collections import deque
from collections.abc import Callable

from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec
from services.mavlink_io.io.links import ByteLinks, Received
from services.mavlink_io.packet import MavlinkPacket
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.ardusub_double.board import BoardDouble

SERVICE = "ardusub"  # it is told of arrivals as long as it runs
STEP_HZ = 400.0  # [1/s] twice the board's own rate


class MemoryLink(ByteLinks):
    """The service's end of the cable. It can be cut, and bytes can be put into it."""

    def __init__(self) -> None:
        self.up, self.down = deque[bytes](), deque[bytes]()
        self.cut = False
        self.notify: Callable[[], None] = lambda: None

    @property
    def names(self) -> list[str]:
        return ["board"]

    @property
    def trouble(self) -> str:
        return ""

    def start(self, notify: Callable[[], None]) -> None:
        self.notify = notify

    def receive(self) -> list[Received]:
        found = list(self.up)
        self.up.clear()
        return [] if self.cut else [Received("board", found)]

    def send(self, link: str, frame: bytes) -> None:
        if not self.cut and link in self.names:
            self.down.append(frame)

    def close(self) -> None:
        self.cut = True


class BoardOnHost:
    """A board stepped by a virtual host, and another ground station at the same board."""

    def __init__(self, host: VirtualHost, board: BoardDouble) -> None:
        self.board, self.link, self._host = board, MemoryLink(), host
        self.heard: list[MavlinkPacket] = []  # from the service
        self.alive = True
        self._codec = MavlinkCodec(board.system, 1)
        self._reader = FrameReader(self._codec)
        node = host.node("board", ["drone"])
        node.every(STEP_HZ, self.step)

    def other_station(self, packet: MavlinkPacket, now: int) -> None:
        """A packet of another ground station."""
        self.board.hear(packet._replace(system=packet.system or 254, component=190), now)

    def step(self, now: int) -> None:
        while self.link.down:
            for packet in self._reader.read([self.link.down.popleft()]):
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
