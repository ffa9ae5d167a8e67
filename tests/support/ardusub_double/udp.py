"""The board as a process: MAVLink over UDP on 127.0.0.1, in real time.

python -m tests.support.ardusub_double.udp --to 14551 --version 4.8 --set FS_PILOT_TIMEOUT=1
"""

import argparse
import contextlib
import os
import select
import socket
import time
from collections.abc import Sequence

from services.marine.vehicle import Vehicle
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec
from services.mavlink_io.packet import MavlinkPacket
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.settings import defaults

HOST = "127.0.0.1"
ANSWERS = ("COMMAND_ACK", "AUTOPILOT_VERSION", "TIMESYNC")
STEP_S = 0.0025  # [s] half a tick of the board


def main() -> None:
    """Ends with its parent, or when it is told to."""
    parser = argparse.ArgumentParser(description="A double of a board with ArduSub, over UDP.")
    parser.add_argument("--to", type=int, required=True, help="UDP port on 127.0.0.1")
    parser.add_argument("--beside", type=int, help="UDP port of a second link")
    parser.add_argument("--version", default="4.8", choices=["4.5", "4.8"], help="of ArduSub")
    parser.add_argument("--vehicle", default="bluerov2_heavy", help="name, or a TOML file")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter of the board"
    )
    said = parser.parse_args()
    try:
        board = board_of(said.vehicle, said.version, said.set)
    except (LindyError, ValueError) as error:
        parser.error(f"{said.vehicle}: {error}")
    print(f"ArduSub {said.version} with {said.vehicle} → {HOST}:{said.to}", flush=True)
    with contextlib.suppress(KeyboardInterrupt):
        run(board, [said.to, *([said.beside] if said.beside else [])], os.getppid())


def board_of(vehicle: str, version: str, assignments: Sequence[str]) -> BoardDouble:
    """
    Raises:
        LindyError: no such vehicle.
        ValueError: no such parameter, or the board cannot drive its thrusters.
    """
    stack, params = Stack(vehicle=vehicle), dict[str, float]()
    for name, _, value in (assignment.partition("=") for assignment in assignments):
        params[name] = float(value)
    if unknown := params.keys() - defaults(version).keys():
        raise ValueError(f"no parameter is called {unknown.pop()}")
    body, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    return BoardDouble(body, place, version=version, params=params)


def run(board: BoardDouble, ports: Sequence[int], parent: int) -> None:
    """Serve whoever listens on these ports until the parent process ends, as a board with several
    links does: an answer goes to who asked, and of what one says the others hear the heartbeats."""
    with contextlib.ExitStack() as stack:
        links = [_Link(stack.enter_context(_socket()), port, board.system) for port in ports]
        while os.getppid() == parent:
            ready, _, _ = select.select([link.socket for link in links], [], [], STEP_S)
            now = time.monotonic_ns()
            for link in links:
                if link.socket in ready:
                    _hear(board, link, links, now)
            board.advance(now)
            for packet in board.sent():
                for link in links:
                    link.send(packet)


def _hear(board: BoardDouble, link: "_Link", links: Sequence["_Link"], now: int) -> None:
    for packet in link.received():
        board.hear(packet, now)
        for said in board.sent():
            for other in [link] if said.name in ANSWERS else links:
                other.send(said)
        if packet.name == "HEARTBEAT":
            for other in links:
                if other is not link:
                    other.pass_on(packet)


class _Link:
    """One of the board's, and who listens at its other end."""

    def __init__(self, socket: socket.socket, port: int, system: int) -> None:
        self.socket, self._port = socket, port
        self._codec = MavlinkCodec(system, 1)
        self._reader = FrameReader(self._codec)

    def received(self) -> list[MavlinkPacket]:
        data, _ = self.socket.recvfrom(2048)
        return self._reader.read([data], datagrams=True)

    def send(self, packet: MavlinkPacket) -> None:
        self.socket.sendto(self._codec.encode(packet), (HOST, self._port))

    def pass_on(self, packet: MavlinkPacket) -> None:
        """In the name of who said it."""
        frame = MavlinkCodec(packet.system, packet.component).encode(packet)
        self.socket.sendto(frame, (HOST, self._port))


def _socket() -> socket.socket:
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind((HOST, 0))
    return link


if __name__ == "__main__":
    main()
