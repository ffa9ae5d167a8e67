"""The board as a process: MAVLink over UDP on 127.0.0.1, in real time.

python -m tools.research.ardusub_double.udp --to 14551 --version 4.8 --set FS_PILOT_TIMEOUT=1
"""

import argparse
import contextlib
import os
import select
import socket
import time
from collections.abc import Sequence

from services.ardusub.io.codec import BoardCodec, FrameReader
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tools.research.ardusub_double.board import BoardDouble

HOST = "127.0.0.1"
STEP_S = 0.0025  # [s] half a tick of the board


def main() -> None:
    """Ends with its parent, or when it is told to."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--to", type=int, required=True, help="UDP port on 127.0.0.1")
    parser.add_argument("--beside", type=int, help="port of a second link")
    parser.add_argument("--version", default="4.8", choices=["4.5", "4.8"])
    parser.add_argument("--vehicle", default="bluerov2_heavy")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    said = parser.parse_args()
    stack = Stack(vehicle=said.vehicle)
    pairs = [assignment.split("=") for assignment in said.set]
    board = BoardDouble(
        stack.section("vehicle", Vehicle),
        stack.section("simulator", Settings),
        version=said.version,
        params={name: float(value) for name, value in pairs},
    )
    with contextlib.suppress(KeyboardInterrupt):
        run(board, [said.to, *([said.beside] if said.beside else [])], os.getppid())


def run(board: BoardDouble, ports: Sequence[int], parent: int) -> None:
    """Serve whoever listens on these ports until the parent process ends. Of what one of them says
    the others hear the heartbeats, as at a board with several links."""
    codec = BoardCodec(board.system, 1)
    with contextlib.ExitStack() as stack:
        links = {stack.enter_context(_socket()): port for port in ports}
        readers = {link: FrameReader(BoardCodec(board.system, 1)) for link in links}
        while os.getppid() == parent:
            ready, _, _ = select.select([*links], [], [], STEP_S)
            now = time.monotonic_ns()
            passed_on = list[tuple[socket.socket, bytes]]()
            for link in ready:
                data, _ = link.recvfrom(2048)
                for packet in readers[link].read(data).packets:
                    board.hear(packet, now)
                    if packet.name == "HEARTBEAT":
                        other = BoardCodec(packet.system, packet.component)
                        passed_on.append((link, other.encode(packet)))
            board.advance(now)
            frames = [codec.encode(packet) for packet in board.sent()]
            for link, port in links.items():
                others = [frame for source, frame in passed_on if source is not link]
                for frame in [*frames, *others]:
                    link.sendto(frame, (HOST, port))


def _socket() -> socket.socket:
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind((HOST, 0))
    return link


if __name__ == "__main__":
    main()
