"""Real sockets on this machine: UDP both ways, TCP, floods, and addresses that are no good."""

import socket
import threading
import time
from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager, suppress

import pytest

from messages.events import Outbox
from services.mavlink.core import Settings
from services.mavlink.service import GROUND_STATIONS
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec, MavlinkEndpoint
from services.mavlink_io.io.links import Links
from services.mavlink_io.packet import MavlinkPacket, heartbeat
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tests.support.doors import free_port
from tests.support.patience import PATIENCE_S, until

HEARTBEAT = heartbeat()


class Drone:
    """An endpoint with its links. Somebody looks at it whenever something arrives."""

    def __init__(self, *urls: str) -> None:
        self.outbox = Outbox()
        self._links = Links(urls, "mavlink.links", GROUND_STATIONS, self.outbox)
        self._endpoint = MavlinkEndpoint(self._links, self.outbox, 1, 1)
        self._lock = threading.Lock()  # as a service does: one handler at a time
        self._heard: list[MavlinkPacket] = []
        self._links.start(self._look)
        self.close = self._links.close

    def _look(self) -> None:
        with self._lock:
            self._heard = (self._heard + self._endpoint.receive())[-1000:]

    def received(self) -> list[MavlinkPacket]:
        with self._lock:
            found, self._heard = self._heard, []
        return found

    def send(self, packet: MavlinkPacket, link: str | None = None) -> None:
        with self._lock:
            self._endpoint.send(packet, link)

    @property
    def names(self) -> list[str]:
        return self._endpoint.names

    @property
    def counts(self) -> Counter[str]:
        return self.outbox.counts


def frame() -> bytes:
    return MavlinkCodec(255, 1).encode(HEARTBEAT)


@contextmanager
def opened(*urls: str) -> Generator[Drone]:
    drone = Drone(*urls)
    try:
        yield drone
    finally:
        drone.close()


def heard(links: Drone, least: int = 1) -> list[MavlinkPacket]:
    """Messages of the dialect: nothing tells whether others are whole."""
    found: list[MavlinkPacket] = []

    def enough() -> bool:
        found.extend(packet for packet in links.received() if packet.fields)
        return len(found) >= least

    until(enough)
    return found


def test_a_ground_station_that_listens_hears_and_is_heard() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(PATIENCE_S)
        port = ground.getsockname()[1]
        with opened(f"udpout:127.0.0.1:{port}") as links:
            assert links.names == [f"udp 127.0.0.1:{port}"]
            links.send(HEARTBEAT)
            data, drone = ground.recvfrom(300)
            assert data[7] == 0  # HEARTBEAT
            ground.sendto(frame(), drone)
            (packet,) = heard(links)
            assert packet[2:] == (255, 1, f"udp 127.0.0.1:{port}")


def test_nobody_listens_yet_and_nothing_is_lost_by_it() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with opened(f"udpout:127.0.0.1:{port}") as links:
        for _ in range(5):
            links.send(HEARTBEAT)
            time.sleep(0.005)  # the refusal comes back through the kernel
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
            ground.bind(("127.0.0.1", port))
            ground.settimeout(PATIENCE_S)
            links.send(HEARTBEAT)
            links.send(HEARTBEAT)  # the first may find the refusal of the last
            assert ground.recv(300)[7] == 0
        assert not links.counts


@pytest.mark.parametrize("kind", ["tcpin", "udpin"])
def test_ground_stations_that_connect_are_told_apart_and_forgotten(kind: str) -> None:
    stream = kind == "tcpin"
    socket_kind = socket.SOCK_STREAM if stream else socket.SOCK_DGRAM
    port = free_port(socket_kind)
    with opened(f"{kind}:127.0.0.1:{port}") as links:
        grounds = [socket.socket(socket.AF_INET, socket_kind) for _ in range(2)]
        for ground in grounds:
            ground.settimeout(PATIENCE_S)
            ground.connect(("127.0.0.1", port))
            ground.send(frame())
        senders = {packet.link for packet in heard(links, 2)}
        assert senders == set(links.names)
        assert len(senders) == 2
        one = links.names[0]
        links.send(HEARTBEAT, one)
        asked = [g for g in grounds if one.endswith(f":{g.getsockname()[1]}")]
        assert asked[0].recv(300)[7] == 0
        for ground in grounds:
            ground.close()
        if stream:
            until(lambda: links.names == [])


def test_more_ground_stations_than_there_is_room_for_are_counted() -> None:
    port = free_port(socket.SOCK_STREAM)
    with opened(f"tcpin:127.0.0.1:{port}") as links:
        many = GROUND_STATIONS.most + 3
        grounds = [socket.create_connection(("127.0.0.1", port)) for _ in range(many)]
        until(lambda: links.counts["too_many:mavlink"] == 3)
        assert len(links.names) == GROUND_STATIONS.most
        for ground in grounds:
            ground.close()


def test_a_ground_station_that_does_not_read_holds_up_nobody_and_gets_whole_frames() -> None:
    port = free_port(socket.SOCK_STREAM)
    with opened(f"tcpin:127.0.0.1:{port}") as links, socket.socket() as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.connect(("127.0.0.1", port))
        slow.settimeout(0.1)
        until(lambda: len(links.names) == 1)
        while not links.counts["dropped:mavlink"]:
            links.send(HEARTBEAT)  # never waits
        ours, read = FrameReader(MavlinkCodec(255, 1), outbox := Outbox()), 0
        with suppress(TimeoutError):
            while True:
                read += len(ours.read([slow.recv(1024)]))
        links.send(HEARTBEAT)
        links.send(HEARTBEAT)
        read += len(ours.read([slow.recv(1024)]))
        assert read > 100
        assert not outbox.counts


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("tcpin:0.0.0.0:5760", "mavlink: tcpin:0.0.0.0:5760 goes over the network"),
        ("udpout:192.168.2.1:14550", "MAVLink has no keys"),
        ("udpin:ground:14550", "mavlink.insecure = true"),
        ("udpout:127.0.0.1:99999", "between 1 and 65535"),
        ("serial:/dev/ttyACM0", "links"),
    ],
)
def test_an_address_that_is_no_good_is_one_sentence(url: str, sentence: str) -> None:
    with pytest.raises(LindyError, match=sentence):
        Stack(overrides=[f'mavlink.links=["{url}"]']).section("mavlink", Settings)


def test_a_link_over_the_network_is_for_who_says_so() -> None:
    links = 'mavlink.links=["udpin:0.0.0.0:14550"]'
    stack = Stack(overrides=[links, "mavlink.insecure=true"])
    assert stack.section("mavlink", Settings).links == ("udpin:0.0.0.0:14550",)


def test_a_number_that_does_not_fit_is_counted_and_not_sent() -> None:
    with opened(f"udpout:127.0.0.1:{free_port(socket.SOCK_DGRAM)}") as links:
        links.send(HEARTBEAT._replace(fields=HEARTBEAT.fields | {"type": 10**9}))
        assert links.counts == {"does_not_fit:HEARTBEAT": 1}
