"""A pilot leaves the drone he flies and takes another: what is done in which order. Pure.

1. **opening**: the topside of the other drone is started, all but its pilot. The flight goes on. If
   it cannot be started, nothing has changed.
2. **releasing**: control of the first drone is given up, without disarming it, so that nothing said
   to it moves it any more. A drone that does not answer notices by itself that its pilot is gone.
3. **silencing**: the pilot of the first drone is ended: its sticks are silent.
4. **starting**: the pilot of the other drone is started, and asks for control. A device that was
   opened anew moves nothing until its sticks were centred. If it cannot be started, the pilot of
   the first drone is started again.

So at no instant are there two pilots of one pair of hands.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal, NamedTuple

from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.fleet.names import clean, in_words

RELEASE_NS = 400_000_000  # [ns] for the drone to answer that nobody has it any more
SILENCE_NS = 500_000_000  # [ns] for a pilot's process to end by itself
START_NS = 10_000_000_000  # [ns] for a pilot's process to be there

Phase = Literal["flying", "opening", "releasing", "silencing", "starting"]
# What is to be done: open the new side; have its opening ended; release the old drone; end the old
# pilot, kill it; begin the new pilot; go over to the new side, or back to the old one
Act = Literal["open", "give_up", "release", "silence", "kill", "begin", "go_over", "go_back"]


class ChangeSeen(NamedTuple):
    """Of both sides, now."""

    opened: bool = False  # all of the new side but its pilot is alive
    failed: str = ""  # why the new side cannot go on
    released: bool = False  # this side's pilot has no control of the first drone
    silent: bool = False  # the first drone's pilot has ended
    alive: bool = False  # the new side's pilot is alive


@dataclass(slots=True)
class ChangeOfDrone:
    """Times `now` are int ns, never decreasing."""

    drone: str  # that is flown
    wanted: str = ""  # to be flown; empty: no change is going on
    failed: str = ""  # why the newest change was not made; empty: it was
    phase: Phase = "flying"
    _since: Ns = 0  # [ns] when the phase began
    _killed: bool = False

    def refusal(self, wanted: str, there: Collection[str]) -> str:
        """Why a drone cannot be taken now; empty: it can.

        Args:
            there: names of the drones that can be reached.
        """
        try:
            checked_name(wanted, "fly")
        except LindyError as error:
            return clean(str(error), 400)
        if self.wanted:
            return f"the change to {self.wanted} is going on"
        if wanted == self.drone:
            return f"{wanted} is flown already"
        if wanted not in there:
            who = f"there are {in_words(there)}" if there else "none can be reached"
            return f"no drone is called {wanted}; {who}"
        return ""

    def order(self, wanted: str, now: Ns) -> Act:
        """Begin with it. It was not refused."""
        self.wanted, self.failed = wanted, ""
        self._enter("opening", now)
        return "open"

    def step(self, seen: ChangeSeen, now: Ns) -> Act | None:
        """What is to be done next. Call it often."""
        spent = now - self._since
        match self.phase:
            case "flying":
                return None
            case "opening" if seen.failed:
                return self._stay(seen.failed, "give_up", now)
            case "opening" if seen.opened:
                return self._enter("releasing", now, "release")
            case "releasing" if seen.released or spent >= RELEASE_NS:
                return self._enter("silencing", now, "silence")
            case "silencing" if seen.silent:
                return self._enter("starting", now, "begin")
            case "silencing" if spent >= SILENCE_NS and not self._killed:
                self._killed = True
                return "kill"
            case "starting" if seen.failed:
                return self._stay(seen.failed, "go_back", now)
            case "starting" if seen.alive:
                self.drone, self.wanted = self.wanted, ""
                return self._enter("flying", now, "go_over")
            case "starting" if spent >= START_NS:
                why = f"its pilot was not alive after {START_NS / 1e9:g} s"
                return self._stay(why, "go_back", now)
            case _:
                return None

    def _stay(self, why: str, act: Act, now: Ns) -> Act:
        """The drone that is flown is not changed."""
        self.failed, self.wanted = why, ""
        return self._enter("flying", now, act)

    def _enter(self, phase: Phase, now: Ns, act: Act = "open") -> Act:
        self.phase, self._since, self._killed = phase, now, False
        return act


def left_behind(
    name: str, status: VehicleStatus | None, patience_s: float, *, released: bool
) -> str:
    """What becomes of a drone that its pilot has left, in one sentence.

    Args:
        status: the newest that was heard of it; None: none.
        patience_s: [s] without a pilot before the drone rises.
        released: it has answered that nobody has control now.
    """
    rises = f"{patience_s:.0f} s"
    if status is None or not released:
        last = "" if status is None else f", {_state(status)} when it was last heard"
        return (
            f"{name} does not answer{last}: an armed drone that hears no pilot stops and holds, "
            f"and rises after {rises}"
        )
    if status.pilot:
        return f"{name} is left to {clean(status.pilot)}, who has control"
    if not status.armed:
        return f"{name} is left{_depth(status)}, disarmed, nobody flies it"
    if status.failsafe not in ("none", "pilot_lost", "link_lost"):  # it is about to lose its pilot
        return f"{name} is left{_depth(status)}, armed, nobody flies it: {clean(status.words, 400)}"
    return f"{name} holds{_depth(status)}, armed, nobody flies it; it rises after {rises}"


def _state(status: VehicleStatus) -> str:
    return f"{'armed' if status.armed else 'disarmed'}{_depth(status)}"


def _depth(status: VehicleStatus) -> str:
    return f" at {status.depth:.1f} m" if isinstance(status.depth, float) else ""
