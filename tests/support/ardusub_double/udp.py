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
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.settings import defaults

HOST = "127.0.0.1"
STEP_S = 0.0025  # [s] half a tick of the board


def main() -> None:
    """Ends with its parent, or when it is told to."""
    parser = argparse.ArgumentParser(description="A double of a board with ArduSub, over UDP.")
    parser.add_argument("--to", type=int, required=True, help="UDP port on 127.0.0.1")
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
        run(board, said.to, os.getppid())


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


def run(board: BoardDouble, port: int, parent: int) -> None:
    """Serve whoever listens on this port until the parent process ends."""
    codec = MavlinkCodec(board.system, 1)
    reader = FrameReader(codec)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind((HOST, 0))
        while os.getppid() == parent:
            ready, _, _ = select.select([link], [], [], STEP_S)
            now = time.monotonic_ns()
            if ready:
                for packet in reader.read([link.recvfrom(2048)[0]], datagrams=True):
                    board.hear(packet, now)
            board.advance(now)
            for packet in board.sent():
                link.sendto(codec.encode(packet), (HOST, port))


if __name__ == "__main__":
    main()
