"""The drones that can be reached, and a page's order to fly another one. Pure.

`lindy fly` says which drones there are, and carries out the order: it ends this service, and starts
that of the other drone at the same address. So what is heard here of an order is only that it was
refused.
"""

from dataclasses import dataclass

from messages.fly import DroneList, FlyAnswer, FlyRequest
from messages.units import Ns

SHOWN_NS = 20_000_000_000  # [ns] for which pages are shown what became of an order


@dataclass(slots=True)
class DroneOrder:
    """`words` is what every page is shown of the newest order."""

    drones: DroneList | None = None  # the newest list; None: there is none, or it is too old
    words: str = ""
    _until: Ns = 0  # [ns] words are shown
    _wanted: str = ""  # of an order that is not answered yet

    def refusal(self, drone: str) -> str:
        """Why the order is not passed on; empty: it is. Whether the drone can be flown, `lindy fly`
        knows."""
        if self.drones is None:
            return f"fly {drone}: this dive was not started by `lindy fly`, so it has one drone"
        if self._wanted:
            return f"fly {drone}: the change to {self._wanted} is going on"
        return ""

    def ask(self, drone: str, now: Ns) -> FlyRequest:
        self._wanted = drone
        self._say(f"changing to {drone}", now)
        return FlyRequest(stamp_ns=0, id="", drone=drone)

    def answered(self, request: FlyRequest, answer: FlyAnswer, now: Ns) -> None:
        self._wanted = ""
        if not answer.accepted:
            self._say(f"not changed to {request.drone}: {answer.reason}", now)

    def given_up(self, request: FlyRequest, now: Ns) -> None:
        self._wanted = ""
        self._say(f"changing to {request.drone}: `lindy fly` does not answer", now)

    def look(self, drones: DroneList | None, now: Ns) -> None:
        """The newest list, and what is not shown any longer."""
        self.drones = drones
        if now >= self._until and not self._wanted:
            self.words = ""

    def _say(self, words: str, now: Ns) -> None:
        self.words, self._until = words, now + SHOWN_NS
