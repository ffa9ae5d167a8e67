"""Stick positions, and what a stick source reads at one instant."""

from collections.abc import Set
from dataclasses import dataclass
from typing import NamedTuple

from messages.link import LatencyBudget, LinkRequest
from messages.simulator import FaultRequest
from messages.units import Ns
from services.piloting.keys import HOLD_NS
from services.piloting.pilot_intents import Held, Intent, Press

# Of a script: a part of the simulated vehicle fails, or the emulated link changes.
Incident = FaultRequest | LinkRequest


class Sticks(NamedTuple):
    """-1 … 1 each, SNAME signs: + forward, starboard, down, clockwise; the camera + upwards, the
    gripper + opens."""

    surge: float = 0.0
    sway: float = 0.0
    heave: float = 0.0
    yaw: float = 0.0
    tilt: float = 0.0
    gripper: float = 0.0

    @property
    def at_rest(self) -> bool:
        """No stick moves the drone. Camera and gripper may move: that does not prevent arming."""
        return not any(self[:4])


CENTRED = Sticks()


class StickReading(NamedTuple):
    """What a stick source reads at one instant."""

    sticks: Sticks = CENTRED
    present: bool = True  # False: the pad is unplugged, unlike centred
    at_rest: bool = True  # the device's sticks are centred, even where `sticks` is held at 0
    age_ms: float = 0.0  # [ms] since the device last answered
    presses: tuple[Intent, ...] = ()  # requests since the last reading, from a button or a script
    incidents: tuple[Incident, ...] = ()  # of a script, since the last reading


class Holds:
    def __init__(self) -> None:
        self._since: dict[Press, Ns | None] = {}  # None: done, or not to be counted

    def read(self, down: Set[Press], counted: Set[Press], now: Ns) -> tuple[Held, ...]:
        """Requests whose hold is complete now; each once, until it was let go.

        Args:
            down: what is held now.
            counted: of it, what may begin to count. The rest does nothing until it was let go.
        """
        self._since = {p: s for p, s in self._since.items() if p in down}
        for press in down - self._since.keys():
            self._since[press] = now if press in counted else None
        done = tuple(
            Held(press, since)
            for press, since in self._since.items()
            if since is not None and now >= since + HOLD_NS
        )
        self._since |= {held.press: None for held in done}
        return done


STAGE = "reference"  # of the latency budget: the wait for the next state
AIM_MS = 1.5  # [ms] of that wait: a command that is later by more waits for the state after
WORTHWHILE_MS = 0.5  # [ms] that a shift is worth
SETTLED = 6  # budgets after a shift that still know commands of before it: three seconds at 2 Hz


@dataclass(slots=True)
class StickPhase:
    _since: int = 0  # budgets since the newest shift

    def shift(self, budget: LatencyBudget) -> Ns:
        """[ns] By which the next command is to be sent later; negative: sooner."""
        self._since += 1
        wait = next((stage.p50_ms for stage in budget.down or () if stage.name == STAGE), None)
        if wait is None or self._since < SETTLED or abs(wait - AIM_MS) < WORTHWHILE_MS:
            return 0
        self._since = 0
        return round((wait - AIM_MS) * 1e6)
