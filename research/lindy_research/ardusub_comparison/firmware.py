"""ArduSub's firmware in its own simulator as a process, and what that simulator knows.

Everything is on 127.0.0.1 and in real time. The pilot speaks on the first link; the truth, the
message SIM_STATE, comes on the second, stamped at its arrival.
"""

import socket
import subprocess
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lindy_research.ardusub_comparison.releases import TrueMotion
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec
from services.mavlink_io.packet import MavCommand, MavlinkPacket, command, heartbeat

# No RC receiver, as on every tethered ROV, and a depth sensor without the noise that no water has.
PARAMETERS = """FRAME_CONFIG 2
SIM_RC_FAIL 1
SIM_BARO_RND 0.002
SIM_BAR2_RND 0.002
FS_PILOT_TIMEOUT 1
"""
HOME = "63.4,10.4,0,90"  # at an altitude of 0, where single precision is finest
SIM_STATE, INTERVAL_US = 108, 20_000
OBSERVER = 250  # system: its sticks would be ignored
ASK_S = 1.0  # [s] between two requests


Tells = Callable[[float, dict[str, Any]], list[MavlinkPacket]]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def firmware(
    path: str, port: int, truth: int, folder: Path, parameters: str = ""
) -> Generator[None]:
    """It calls `port` for the pilot and `truth` for the observer. Writes into `folder` only.

    Args:
        parameters: besides those above.
    """
    folder.mkdir(parents=True)
    (folder / "lindy.parm").write_text(PARAMETERS + parameters)
    said = [path, "--model", "vectored_6dof", "-S", "-I0", "--home", HOME]
    said += ["--defaults", "lindy.parm", "--serial0", f"udpclient:127.0.0.1:{port}"]
    said += ["--serial1", f"udpclient:127.0.0.1:{truth}", "--serial2", "none:"]  # not port 5763
    with (folder / "board.log").open("wb") as log:
        process = subprocess.Popen(said, cwd=folder, stdout=log, stderr=log)
        try:
            yield
        finally:
            process.kill()
            process.wait()


class TruthObserver:
    """Asks for SIM_STATE and keeps it, on a thread of its own.

    Args:
        tells: makes of each what the board is to be told.
    """

    def __init__(self, port: int, tells: Tells | None = None) -> None:
        self._tells = tells
        self._rows: list[tuple[float, ...]] = []  # of TrueMotion
        self._codec = MavlinkCodec(OBSERVER, 191, "ardupilotmega")
        self._reader = FrameReader(self._codec)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.2)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._observe, daemon=True)
        self._thread.start()

    def close(self) -> TrueMotion:
        self._ended.set()
        self._thread.join()
        self._socket.close()
        rows = np.array(self._rows).reshape(-1, len(TrueMotion._fields))
        rows[:, -1] = np.unwrap(rows[:, -1])
        return TrueMotion(*rows.T)

    def _observe(self) -> None:
        asked = 0.0
        while not self._ended.is_set():
            try:
                data, board = self._socket.recvfrom(4096)
            except TimeoutError:
                continue
            now = time.time()
            if now - asked > ASK_S:
                asked = now
                ask = command(1, MavCommand.SET_MESSAGE_INTERVAL, SIM_STATE, INTERVAL_US)
                for packet in (heartbeat(), ask):
                    self._socket.sendto(self._codec.encode(packet), board)
            for packet in self._reader.read([data]):
                if packet.name == "SIM_STATE":
                    said = packet.fields
                    down, pitch = -said["alt"], said["pitch"]
                    north, east = said["vn"], said["ve"]
                    self._rows.append((now, down, said["vd"], north, east, pitch, said["yaw"]))
                    for told in self._tells(now, said) if self._tells else ():
                        self._socket.sendto(self._codec.encode(told), board)
