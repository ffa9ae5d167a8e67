"""`lindy fly`: one drone after the other, in one program."""

import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Literal

from messages import topics
from messages.fly import FlyAnswer, FlyRequest
from messages.identity import SideIdentity
from services.runtime.bus.network import Network
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import messages_hash
from services.runtime.node.answers import KeptAnswers
from tools.fleet.change import Act, ChangeOfDrone, ChangeSeen
from tools.fleet.fleet import watched
from tools.fleet.flown_topside import FlownTopside, opened
from tools.fleet.reachable import drone_list, still_armed
from tools.fleet.watching import FleetWatch
from tools.live.display import Display, display
from tools.live.dive_folder import point_latest
from tools.live.stop_signals import StopSignals
from tools.start import Planned

PASSING_NS = 3_000_000_000  # [ns] for a change to finish when the user wants to stop
LIST_NS = round(1e9 / topics.FLY_DRONES.hz)  # [ns] between two lists of the drones
GOES_ON = "the flight goes on"


def fly_one_after_the_other(
    first: Planned, network: Network, for_drone: Callable[[str], Planned]
) -> int:
    """Returns the exit status: the worst of all flights.

    Args:
        network: of the router where the drones are.
        for_drone: the same topside, for the drone of this name.

    Raises:
        LindyError: the first one cannot be started, or one was aborted.
    """
    with StopSignals() as stop:
        with display() as shown, SuccessiveTopsides(stop, shown, network, for_drone) as flights:
            flights.fly(first)
        return stop.report(flights.sum_up, "the reports are on the drones' sides")


class SuccessiveTopsides:
    """The main thread looks after the flight that is flown; other threads open the next one, and
    end those that were left."""

    def __init__(
        self,
        stop: StopSignals,
        shown: Display,
        network: Network,
        for_drone: Callable[[str], Planned],
    ) -> None:
        self._stop, self._shown, self._for_drone = stop, shown, for_drone
        self._watch = FleetWatch(messages_hash(topics.ALL))
        self._take_in = watched(network, self._watch)
        self._list_at = 0  # [ns] next list of the drones
        self._left = ""  # what has become of the drone that was left last
        self._background = ThreadPoolExecutor(thread_name_prefix="flight")
        self._endings: list[Future[None]] = []
        self._over = False  # no flight is opened any more
        self._stop_ns = 0  # [ns] when the user wanted to stop
        self._flown: list[FlownTopside] = []  # the last one is flown now
        self._opening: Future[FlownTopside] | None = None
        self._new: FlownTopside | None = None  # opened, and not flown yet
        self._failed = ""  # why the new one cannot go on
        self._change = ChangeOfDrone("")
        self._asked = ""  # id of the order that is carried out
        self._answers = KeptAnswers[FlyAnswer]()

    def __enter__(self) -> "SuccessiveTopsides":
        return self

    def __exit__(self, *_: object) -> None:
        """End whatever is left."""
        self._over = True
        self._collect()
        for flight in (self._new, *self._flown[-1:]):
            if flight is not None:
                self._end(flight)
        self._background.shutdown()
        for flight in self._flown:
            flight.forget()
        for ending in self._endings:
            if (error := ending.exception()) is not None:
                print(f"lindy: a topside did not end cleanly: {error}", file=sys.stderr)

    # The main thread's loop.

    def fly(self, first: Planned) -> None:
        """Fly until the end.

        Raises:
            LindyError: the first flight has no hub.
        """
        flight = self._open(first, announced=True)
        self._flown.append(flight)
        self._change = ChangeOfDrone(flight.drone)
        try:
            point_latest(flight.local.stack.out_dir)
            flight.start(flight.dive.look)
            end = None
            while end is None and not self._may_stop(time.monotonic_ns()):
                end = self._turn()
            self._flight.dive.disarm()
            self._flight.outcome.exit = end or "clean"
        except LindyError as error:
            with self._flight.outcome.of_the_dive():
                raise error from None

    def _may_stop(self, now: int) -> bool:
        """The user wants to stop, and there is one pilot: a change that has begun to pass from one
        drone to the other is finished first, so that the one that is flown is disarmed."""
        if not self._stop.asked:
            return False
        self._stop_ns = self._stop_ns or now
        passing = self._change.phase not in ("flying", "opening")
        return not passing or now >= self._stop_ns + PASSING_NS

    def sum_up(self) -> int:
        """Print what is known of each flight. Returns the worst exit status.

        Raises:
            LindyError: why one was aborted, the first of them.
        """
        worst, aborted = 0, list[LindyError]()
        for line in filter(None, [*self._still_armed(), self._flight.dive.left]):
            print(line, flush=True)
        for flight in self._flown:
            try:
                worst = max(worst, flight.plan.sum_up(flight.outcome))
            except LindyError as error:
                aborted.append(error)
        if aborted:
            raise aborted[0]
        return worst

    def _still_armed(self) -> list[str]:
        """What is to be said of the drones that were left on the way."""
        now = time.monotonic_ns()
        self._take_in(now)
        left = {flight.drone for flight in self._flown} - {self._flight.drone}
        return still_armed(left, self._watch.rows(now))

    @property
    def _flight(self) -> FlownTopside:
        return self._flown[-1]

    def _turn(self) -> str | None:
        """Handle what is due. None: it goes on; then how it ended."""
        self._flight.dive.look()
        self._look_at_new()
        now = time.monotonic_ns()
        self._tell_who_is_there(now)
        act = self._change.step(self._seen(now), now)
        if act is not None:
            self._do(act, now)
        if self._change.phase != "flying":
            return None
        return self._flight.dive.over(now)

    def _tell_who_is_there(self, now: int) -> None:
        if now < self._list_at:
            return
        self._list_at = now + LIST_NS
        self._take_in(now)
        flight = self._flight
        flight.tell(drone_list(self._watch, flight.ours, flight.drone, self._left, now))

    def _look_at_new(self) -> None:
        if self._new is None:
            return
        try:
            self._new.local.pump()
        except LindyError as error:
            self._failed = self._failed or str(error)

    def _seen(self, now: int) -> ChangeSeen:
        phase, flight, new = self._change.phase, self._flight, self._new
        if phase == "opening":
            self._collect()
            return ChangeSeen(opened=self._new is not None, failed=self._failed)
        return ChangeSeen(
            failed=self._failed,
            released=phase == "releasing" and flight.dive.ask_on(now),
            silent=flight.local.has_ended(flight.pilots),
            alive=new is not None and phase == "starting" and not new.local.missing(),
        )

    def _collect(self) -> None:
        """Take what the opening thread has made."""
        if self._opening is None or not (self._over or self._opening.done()):
            return
        opening, self._opening = self._opening, None
        try:
            self._new = opening.result()
        except LindyError as error:
            self._failed = str(error)
        except Exception as error:  # whatever it is, the flight that is flown goes on
            self._failed = f"{type(error).__name__}: {error}"

    # What a change does.

    def _hear(self, request: FlyRequest, now: int) -> None:
        """An order to fly another drone; repeated until it is answered."""
        if request.id == self._asked:
            said = FlyAnswer(stamp_ns=now, id=request.id, accepted=True, under_way=True)
            self._flight.answer(said)
            return
        if (known := self._answers.to(request.id, now)) is not None:
            self._flight.answer(known)
            return
        reason = self._change.refusal(request.drone, self._flight.there())
        if reason:
            self._answer(request.id, reason)
            return
        self._asked, self._failed = request.id, ""
        self._do(self._change.order(request.drone, now), now)

    def _answer(self, request_id: str, reason: str, left: str = "", folder: str = "") -> None:
        answer = FlyAnswer(
            stamp_ns=time.monotonic_ns(),
            id=request_id,
            accepted=not reason,
            reason=reason[:1000],
            left=left[:1000],
            folder=folder[:2000],
        )
        self._flight.answer(self._answers.keep(answer))

    def _do(self, act: Act, now: int) -> None:
        flight, new = self._flight, self._new
        match act:
            case "open":
                self._say("info", f"changing to {self._change.wanted}")
                self._opening = self._background.submit(self._prepared, self._change.wanted)
            case "release":
                flight.dive.release()
                flight.dive.ask_on(now)
            case "silence":
                flight.local.rest(flight.pilots)
            case "kill":
                for name in flight.pilots:
                    flight.local.supervisor.kill(name)
            case "begin" if new is not None:
                new.local.begin(new.pilots)
            case "go_over" if new is not None:
                self._go_over(flight, new)
            case "go_back":
                flight.local.begin(flight.pilots)
                self._stay(f"take control of {flight.drone} again, by arming or resuming")
            case _:
                self._stay(GOES_ON)

    def _go_over(self, old: FlownTopside, new: FlownTopside) -> None:
        left = old.left(released=old.dive.ask_on(time.monotonic_ns()))
        self._answer(self._asked, "", left, str(new.local.stack.out_dir))
        old.leave(new.local.stack.out_dir)
        self._flown.append(new)
        self._asked, self._new = "", None
        new.take_over()
        self._left, self._list_at = left, 0  # told at once
        self._say("warning", left)
        self._end(old)

    def _stay(self, then: str) -> None:
        """The drone that is flown is not changed."""
        self._say("error", f"the drone was not changed: {self._change.failed}; {then}")
        then = "" if then == GOES_ON else f"; {then}"
        self._answer(self._asked, f"{self._change.failed}{then}")
        if self._new is not None:
            self._end(self._new)
        self._asked, self._new, self._failed = "", None, ""

    def _say(self, level: Literal["info", "warning", "error"], text: str) -> None:
        self._flight.local.node.log(level, text)

    # Other threads.

    def _prepared(self, drone: str) -> FlownTopside:
        """The flight of another drone, all but its pilot."""
        flight = self._open(self._for_drone(drone), announced=False)
        try:
            flight.prepare(lambda: self._identity(drone), lambda: not self._over)
        except BaseException:
            flight.end()
            raise
        return flight

    def _identity(self, drone: str) -> SideIdentity | None:
        """What a drone says of itself; the main thread takes it in."""
        known = self._watch.roster.drones.get(drone)
        return None if known is None else known.identity

    def _open(self, plan: Planned, *, announced: bool) -> FlownTopside:
        return opened(plan, self._stop, self._shown, self._hear, announced=announced)

    def _end(self, flight: FlownTopside) -> None:
        self._endings.append(self._background.submit(flight.end))
