"""When a dive begins and ends. The same for real and for virtual time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from messages.events import TOLD, note
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError

PATIENCE_S = 60.0  # [s] after a script's end, before a dive is ended anyway
ARMING_S = 30.0  # [s] a script waits for the drone to arm; a person may wait for ever
EARLY_S = 1.0  # [s] by which the script may have started before the drone was seen armed


@dataclass(slots=True)
class DiveTimeline:
    """Follows `vehicle/status` from the start to the end of the dive.

    While another side's pilot has control, its arming is not the beginning of this dive.
    """

    script_s: float | None  # [s] length of the stick log; None: a person is the pilot
    seconds: float | None = None  # [s] after arming, as asked for with --seconds
    in_control: Callable[[VehicleStatus], bool] = lambda _: True  # is it this side's pilot?
    # What crashed and was started again, in words: often why a sensor lacks.
    crashed: Callable[[], Sequence[str]] = list
    began_ns: int = 0  # [ns] when we began to wait for arming
    armed_ns: int | None = None  # [ns] when the drone was first armed
    controlled: bool = False  # this side's pilot has control
    armed: bool = False  # now, by this side's pilot
    note: str = TOLD["no_status"]
    calibrating: bool = False

    def see(self, status: VehicleStatus, now: int) -> None:
        """The newest status arrived at `now` [ns]."""
        self.controlled = self.in_control(status)
        self.armed = status.armed and self.controlled
        self.calibrating = any(each.code == "calibrating" for each in status.notices)
        self.note = note(status.notices) or status.activity
        if status.pilot and not self.controlled:
            self.note = f"{status.pilot} has control"
            self.began_ns = now  # it is watched until it is free
        if self.armed and self.armed_ns is None:
            self.armed_ns = now

    def elapsed_s(self, now: int) -> float | None:
        """[s] Since the drone was first armed, or None."""
        return None if self.armed_ns is None else (now - self.armed_ns) / 1e9

    @property
    def length_s(self) -> float | None:
        """[s] How long the dive will be, as far as it is known before."""
        known = [s for s in (self.script_s, self.seconds) if s is not None]
        return min(known, default=None)

    def over(self, now: int) -> str | None:
        """None while the dive goes on; then `clean`, or why it ended otherwise.

        Raises:
            LindyError: a script has waited too long for the drone to arm.
        """
        elapsed = self.elapsed_s(now)
        if elapsed is None:
            return self._never_armed(now)
        if self.seconds is not None and elapsed >= self.seconds:
            return "clean"
        if self.script_s is None:
            return None
        if not self.armed and elapsed >= self.script_s - EARLY_S:
            return "clean"
        if elapsed >= self.script_s + PATIENCE_S:
            return f"the drone was still armed {PATIENCE_S:g} s after the script's end"
        return None

    def _never_armed(self, now: int) -> None:
        if self.script_s is not None and now - self.began_ns > ARMING_S * 1e9:
            crashed = ", ".join(self.crashed())
            why = f"started again: {crashed}, its lines say why; " if crashed else ""
            raise LindyError(f"the drone did not arm within {ARMING_S:g} s: {why}{self.note}")
