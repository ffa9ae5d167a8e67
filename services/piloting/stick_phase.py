"""When the sticks are sent, so that they do not wait on board.

The reference takes the newest command when its next state comes, 100 times a second. Sent 50 times
a second by a clock of its own, each command waits the same part of these 10 ms: whichever part the
two clocks happen to make, for the whole dive. The link monitor measures that wait, and the sender's
clock is moved until commands arrive just in time.

Pure: one measurement in, one shift out.
"""

from dataclasses import dataclass

from messages.link import LatencyBudget
from messages.units import Ns

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
