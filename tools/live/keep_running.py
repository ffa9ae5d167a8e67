"""A real dive from the start of its services until it is over or the user stops it."""

import time
from collections.abc import Callable

from services.runtime.launch.local_stack import LocalStack
from tools.keys.credentials import OPEN
from tools.live.dive_timeline import DiveTimeline
from tools.live.stop_signals import StopSignals

REMIND_S = 60.0  # [s] between two lines in the log that say that there are no keys
ALIVE_S = 30.0  # [s] for all services to start, on a slow and busy computer


def keep_running(
    local: LocalStack, timeline: DiveTimeline, stop: StopSignals, look: Callable[[], bool]
) -> str:
    """Run until the end. Returns how it ended: `clean`, or why otherwise.

    Args:
        look: handles everything that is due; False: the user wants to stop.

    Raises:
        LindyError: a service cannot start, or the drone does not arm.
    """

    def goes_on() -> bool:
        """The drone may fly, and its dive be over, before the last service is alive."""
        flying = timeline.armed_ns is not None
        return look() and (not flying or timeline.over(time.monotonic_ns()) is None)

    local.start_services()
    local.wait_alive(ALIVE_S, goes_on)
    if local.stack.insecure:
        local.node.log("warning", OPEN)
        local.node.every(1.0 / REMIND_S, lambda _: local.node.log("warning", OPEN))
    timeline.began_ns = time.monotonic_ns()
    end = None
    while end is None and not stop.asked:
        look()
        end = timeline.over(time.monotonic_ns())
    return end or "clean"
