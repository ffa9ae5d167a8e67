"""The viewer process: opens the viewer and sends it the batches from the pipe.

Nothing here affects the visualizer: a viewer that stalls only stalls this process, which
then ends, even when its parent has already ended.
"""

import os
import socket
import subprocess
import sys
import time
from typing import BinaryIO

import msgspec

from services.runtime.os import system
from services.visualizer.batch import Batch
from services.visualizer.io.live_viewer import LENGTH_BYTES, ViewerLaunch
from services.visualizer.io.rerun_writer import RerunWriter

OPEN_S = 20.0  # for the viewer to listen
STALL_S = 10  # a viewer that takes nothing for this long is given up


def main(argument: str) -> int:
    launch = msgspec.json.decode(argument, type=ViewerLaunch)
    port = free_port()
    viewer = subprocess.Popen(
        [*launch.viewer, "--port", str(port)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **system.APART,  # the window outlives the dive
    )
    if not answers(port, viewer, OPEN_S):
        viewer.kill()
        return 1
    writer = RerunWriter(launch.recording_id, launch.vehicle)
    system.end_within(STALL_S)
    writer.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    _feed(writer, sys.stdin.buffer, viewer)
    system.end_within(STALL_S)
    writer.close()
    return 0


def _feed(writer: RerunWriter, pipe: BinaryIO, viewer: subprocess.Popen[bytes]) -> None:
    """Send batches until the pipe is closed or the viewer has ended."""
    decoder = msgspec.msgpack.Decoder(Batch)
    system.end_within(0)
    while (head := pipe.read(LENGTH_BYTES)) and viewer.poll() is None:
        batch = decoder.decode(pipe.read(int.from_bytes(head, "big")))
        system.end_within(STALL_S)
        writer.write(batch)
        system.end_within(0)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def answers(port: int, viewer: subprocess.Popen[bytes], seconds: float) -> bool:
    """Does the viewer listen within this time?"""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and viewer.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            return True
        except OSError:
            time.sleep(0.1)
    return False


if __name__ == "__main__":
    try:
        status = main(sys.argv[1])
    except Exception:  # the pipe's other end reports it
        status = 1
    os._exit(status)  # a normal exit would wait for a viewer that may never answer
