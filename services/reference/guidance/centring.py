"""Have the sticks been centred for long enough to be given back after a short loss? Pure."""

from dataclasses import dataclass

from messages.pilot import PilotCommand
from messages.units import Ns
from services.reference.guidance.axes import centred

CENTRED_NS = 300_000_000  # [ns]


@dataclass(slots=True)
class CentredSticks:
    """Judged by both clocks: a single command stays fresh for a while and proves nothing, and nor
    do many that were held up on the way and arrive at once."""

    _since: tuple[Ns, Ns, int] | None = None  # [ns] here, [ns] stamp of the command; its epoch

    def step(self, command: PilotCommand | None, now: Ns) -> bool:
        """
        Args:
            command: the newest fresh one; None: there is none, or nothing can be given back now.
        """
        if command is None or command.pilot != "present" or not centred(command):
            self._since = None
            return False
        if self._since is None or self._since[2] != command.epoch:
            self._since = (now, command.stamp_ns, command.epoch)
        here, stamp, _ = self._since
        return min(now - here, command.stamp_ns - stamp) >= CENTRED_NS
