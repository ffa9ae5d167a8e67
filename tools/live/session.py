"""A real dive from the start of its services until it is over or the user stops it: piloted from
this machine, and then disarmed, or the drone's side of it."""

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from messages import topics
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from messages.vehicle import VehicleStatus
from services.marine.field_of_view import CameraViews
from services.runtime.launch.local_stack import LocalStack
from services.runtime.node.node import Node
from tools.checks import PilotChoice
from tools.keys.credentials import OPEN
from tools.live.dive_timeline import DiveTimeline
from tools.live.outcome import Outcome, title
from tools.live.screen import Display, PrintedLines, View
from tools.live.stop_signals import StopSignals
from tools.live.watch import Watch
from tools.report.summary import restarted

KNOWN_S = 0.25  # [s] until a status tells who has control now
DISARM_S = 1.0  # [s] at most, for the drone's answer at the end
LOOK_HZ = 25.0  # [1/s] often enough that a port that keeps the newest 16 does not overflow at 50 Hz
WHO = "end-of-dive"
REFUSALS = 5  # of one request, until it is given up
REMIND_S = 60.0  # [s] between two lines in the log that say that there are no keys
ENDS = "somebody on board ended the drone's side: its services end now"
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


class DroneSide:
    """The drone's side of a dive between the start of its hub and the end of its services. Whatever
    it hears, it must not end: the vehicle hangs on it."""

    def __init__(self, local: LocalStack, stop: StopSignals) -> None:
        self._local, self._stop, self._lines = local, stop, PrintedLines()
        self._timeline = DiveTimeline(None, local.stack.seconds)
        node = local.node
        node.each(topics.STATUS, self._timeline.see)
        node.each(topics.LOG, self._show)
        node.show = lambda line: self._show(line, line.stamp_ns)  # nobody hears their own messages

    def keep(self) -> str:
        """Run until the end. Returns how it ended: `clean`, or why otherwise.

        Raises:
            LindyError: a service cannot start.
        """
        try:
            end = keep_running(self._local, self._timeline, self._stop, self._look)
            self._local.node.log("warning", ENDS)  # the pilot would only see that the link is gone
            return end
        finally:
            self._lines.finish()

    def _look(self) -> bool:
        self._local.pump()
        return not self._stop.asked

    def _show(self, line: LogLine, now: int) -> None:
        self._lines.line(line, self._timeline.elapsed_s(now))


class PilotedDive:
    """A dive between the start of the hubs and the end of the services."""

    def __init__(
        self,
        local: LocalStack,
        pilot: PilotChoice,
        stop: StopSignals,
        shown: Display,
    ) -> None:
        self._own = OwnPilot(local.node)
        self._timeline = DiveTimeline(
            pilot.script_s,
            local.stack.seconds,
            self._own.in_control,
            lambda: restarted(local.restarts, local.plan.services.shared),
        )
        stop.armed = lambda: f"armed{self._depth()}" if self._timeline.armed else ""
        self._local, self._stop, self._shown = local, stop, shown
        services = local.plan.services
        cameras = local.stack.section("camera", CameraViews).by_name
        self._watch = Watch(
            local.node, list(services), self._timeline, shown.line, services.shared, cameras
        )
        self._disarming = Disarming(local.node, self._own)
        self._releases = local.stack.apart  # other pilots may go on with the drone
        self._drone = local.stack.drone_name
        self._status: VehicleStatus | None = None  # the newest
        local.node.each(topics.STATUS, self._hear)
        self.left = ""  # what has become of the drone, where it goes on without this side

    def fly(self) -> str:
        """Run the dive. Returns how it ended: `clean`, or why not.

        Raises:
            LindyError: a service cannot start, or the drone does not arm.
        """
        end = keep_running(self._local, self._timeline, self._stop, self.look)
        self.disarm()
        return end

    def look(self) -> bool:
        """Handle everything that is due. False: the user wants to stop."""
        self._local.pump()
        if question := self._stop.question:
            self._stop.question = ""
            self._local.node.log("warning", question)
        self._shown.show(self._view)
        return not self._stop.asked

    def _view(self) -> View:
        local = self._local
        return self._watch.view(
            title(local.stack),
            time.monotonic_ns(),
            local.missing(),
            local.restarts,
            list(local.hang_detector.silent),
        )

    def _depth(self) -> str:
        depth = None if self._status is None else self._status.depth
        return f" at {depth:.1f} m" if isinstance(depth, float) else ""

    def _hear(self, status: VehicleStatus, now: int) -> None:
        self._status = status
        self._timeline.see(status, now)

    def disarm(self) -> None:
        """Ask the drone to disarm, and give control up, if this side's pilot has control. Wait for
        the answers, at most `DISARM_S`."""
        known = time.monotonic() + KNOWN_S
        while time.monotonic() < known:
            self.look()
        disarm = ("disarm",) if self._timeline.armed else ()
        release = ("release",) if self._releases and self._timeline.controlled else ()
        self._disarming.kinds = (*disarm, *release)
        deadline = time.monotonic() + DISARM_S
        while not self._disarming.done and time.monotonic() < deadline:
            self._disarming.ask(time.monotonic_ns())
            self.look()
        status = self._status
        if self._releases and disarm and status is not None and not status.armed:
            self.left = f"{self._drone} is disarmed{self._depth()}: nothing holds it now"


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


class OwnPilot:
    """The pilot of this side: the one whose commands are published here. Commands go from the
    topside to the drone only, so that no other side's are heard here."""

    def __init__(self, node: Node) -> None:
        self.heard = False
        self.epoch = 0  # authority epoch; 0: it was never granted control
        self.source = ""  # its name
        self._commands = node.latest(topics.PILOT_COMMAND)
        node.every(LOOK_HZ, self._look)

    def in_control(self, status: VehicleStatus) -> bool:
        """Was the newest epoch granted to this pilot?"""
        return status.epoch == self.epoch

    def _look(self, now: int) -> None:
        if (command := self._commands.newest(now)) is not None:
            self.heard, self.epoch, self.source = True, command.epoch, command.source


class Disarming:
    """The requests that end a dive: disarm, release control; repeated until the drone answers. It
    asks in the name of this side's pilot: the drone of another pilot stays armed."""

    def __init__(
        self, node: Node, own: OwnPilot, kinds: tuple[RequestKind, ...] = ("disarm",)
    ) -> None:
        self.kinds = kinds  # not answered yet, in this order
        self._own = own
        self._refusals = 0
        self._asking = node.request(
            topics.PILOT_REQUEST, topics.PILOT_ANSWER, on_answer=self._hear, who=WHO
        )

    @property
    def done(self) -> bool:
        """Has the drone answered everything?"""
        return not self.kinds

    def ask(self, now: int) -> None:
        """Send what is next at `now` [ns]; later calls do nothing while it is pending or done."""
        if self.kinds and not self._asking.pending:
            request = PilotRequest(
                stamp_ns=now,
                id="",
                kind=self.kinds[0],
                source=self._own.source,
                epoch=self._own.epoch,
            )
            self._asking.ask(request, now)

    def _hear(self, _request: PilotRequest, answer: PilotAnswer, _now: int) -> None:
        """A refusal may be due to an epoch that has just been replaced: then ask with the new."""
        self._refusals = 0 if answer.accepted else self._refusals + 1
        if answer.accepted or self._refusals >= REFUSALS:
            self.kinds = self.kinds[1:]
            self._refusals = 0
