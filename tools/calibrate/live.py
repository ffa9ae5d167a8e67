"""A calibration of a vehicle whose sensors are on the bus now."""

import threading
import time
from collections.abc import Callable

from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from tools.calibrate.guide import CalibrationGuide, listen

DRONE = "drone"  # the side on which raw samples are
SILENT_S = 5.0  # [s] without a sample at the start


def guide_live(running: Running, guide: CalibrationGuide, say: Callable[[str], None]) -> None:
    """Until the guide has enough; Ctrl-C ends it sooner.

    Raises:
        LindyError: this machine is not the drone's, or nothing is heard.
    """
    if DRONE not in running.endpoints:
        raise LindyError(
            "raw samples stay on the drone: run this on the drone's computer, or give a recording"
        )
    woken = threading.Event()
    with open_bus(running.endpoints[DRONE], running.vehicle) as bus:
        node = Node("calibrate", {DRONE: bus}, time.monotonic_ns, VolatileCheckpoint())
        node.wake = woken.set
        heard = listen(node, guide, say)
        began = time.monotonic()
        while not guide.done:
            woken.wait(max(0.0, (node.deadline() - time.monotonic_ns()) / 1e9))
            woken.clear()
            node.step()
            if not heard() and time.monotonic() - began > SILENT_S:
                raise LindyError(
                    f"no sensor sample in {SILENT_S:.0f} s; does the drone's side run?"
                )
