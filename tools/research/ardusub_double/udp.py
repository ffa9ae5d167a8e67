"""The board as a process: MAVLink over UDP on 127.0.0.1, in real time.

python -m tools.research.ardusub_double.udp --to 14551 --version 4.8 --set FS_PILOT_TIMEOUT=1
"""

import argparse
import contextlib
import os
import select
import socket
import time

from services.ardusub.io.codec import BoardCodec, FrameReader
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tools.research.ardusub_double.board import BoardDouble

STEP_S = 0.0025  # [s] half a tick of the board


def main() -> None:
    """Ends with its parent, or when it is told to."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--to", type=int, required=True, help="UDP port on 127.0.0.1")
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
        run(board, said.to, os.getppid())


def run(board: BoardDouble, port: int, parent: int) -> None:
    """Serve whoever listens on this port until the parent process ends."""
    codec = BoardCodec(board.system, 1)
    reader = FrameReader(codec)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        while os.getppid() == parent:
            ready, _, _ = select.select([link], [], [], STEP_S)
            now = time.monotonic_ns()
            if ready:
                data, _ = link.recvfrom(2048)
                for packet in reader.read(data).packets:
                    board.hear(packet, now)
            board.advance(now)
            for packet in board.sent():
                link.sendto(codec.encode(packet), ("127.0.0.1", port))


if __name__ == "__main__":
    main()
