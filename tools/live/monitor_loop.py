"""The main loop of a real dive: starts the services of this machine, then shows the dive until it
is over or the user stops it."""

import time
from collections.abc import Generator
from contextlib import contextmanager

from messages import topics
from services.marine.field_of_view import CameraViews
from services.runtime.launch.local_stack import LocalStack
from tools.live.display import Display
from tools.live.dive_timeline import DiveTimeline
from tools.live.keep_running import keep_running
from tools.live.outcome import Outcome, title
from tools.live.screen import View
from tools.live.stop_signals import StopSignals
from tools.live.watch import Watch


class MonitorLoop:
    """Made when the hubs are up; the services are started by `keep`."""

    def __init__(
        self, local: LocalStack, timeline: DiveTimeline, stop: StopSignals, shown: Display
    ) -> None:
        self.local, self._timeline, self._stop, self._shown = local, timeline, stop, shown
        services = local.plan.services
        cameras = local.stack.section("camera", CameraViews).by_name
        self._watch = Watch(
            local.node, list(services), timeline, shown.line, services.shared, cameras
        )
        local.node.each(topics.STATUS, timeline.see)

    def keep(self) -> str:
        """Run until the end. Returns how it ended: `clean`, or why otherwise.

        Raises:
            LindyError: a service cannot start, or the drone does not arm.
        """
        return keep_running(self.local, self._timeline, self._stop, self.look)

    def look(self) -> bool:
        """Handle everything that is due. False: the user wants to stop."""
        self.local.pump()
        if question := self._stop.question:
            self._stop.question = ""
            self.local.node.log("warning", question)
        self._shown.show(self._view)
        return not self._stop.asked

    def _view(self) -> View:
        local = self.local
        return self._watch.view(
            title(local.stack),
            time.monotonic_ns(),
            local.missing(),
            local.restarts,
            list(local.hang_detector.silent),
        )


@contextmanager
def followed_by(outcome: Outcome, local: LocalStack) -> Generator[None]:
    """The outcome collects restarts, silences and health messages while the processes run."""
    outcome.restarts = lambda: local.restarts
    outcome.hung = lambda: dict(local.hang_detector.times)
    outcome.shared = local.plan.services.shared
    outcome.listen(local.node)
    local.node.each(topics.STATUS, outcome.see_status)
    try:
        yield
    finally:
        outcome.gone = local.missing()
