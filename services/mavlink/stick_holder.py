"""Which ground station has the sticks: one at a time, by system, component and link."""

from dataclasses import dataclass

from messages.pilot import TTL_MS
from messages.units import Ns
from services.mavlink.packets import GroundStation
from services.piloting.pilot_intents import Intent
from services.piloting.sticks import CENTRED, StickReading, Sticks

TTL_NS = round(TTL_MS * 1e6)  # [ns] sticks older than this move nothing, as any pilot's
# As long as the drone keeps control for a silent pilot (services/reference/guidance/authority.py).
KEPT_NS = 10_000_000_000  # [ns] of silence until another ground station may have them


@dataclass(slots=True)
class StickHolder:
    """The newest stick positions of the one who has them."""

    station: GroundStation | None = None
    tilt: float = 0.0  # [-] of buttons, for the camera
    gripper: float = 0.0  # [-] of buttons
    _sticks: Sticks = CENTRED
    _heard_ns: Ns = 0
    _at_rest_once: bool = False  # its sticks were centred since it has them

    def take(self, station: GroundStation, sticks: Sticks, now: Ns) -> bool:
        """Stick positions arrived. False: another ground station has the sticks.

        Deflected sticks of a new holder move nothing until they were centred once.
        """
        if not self.may_take(station, now):
            return False
        if station != self.station:
            self.station, self._at_rest_once = station, False
            self.tilt = self.gripper = 0.0
        self._sticks, self._heard_ns = sticks, now
        self._at_rest_once = self._at_rest_once or sticks.at_rest
        return True

    def may_take(self, station: GroundStation, now: Ns) -> bool:
        free = self.station is None or now >= self._heard_ns + KEPT_NS
        return free or station == self.station

    def release(self) -> None:
        """The holder lets go."""
        self.station, self._sticks = None, CENTRED
        self.tilt = self.gripper = 0.0

    def age_ns(self, now: Ns) -> Ns:
        """[ns] Since the newest stick positions arrived."""
        return now - self._heard_ns

    def fresh(self, now: Ns) -> bool:
        return self.station is not None and self.age_ns(now) <= TTL_NS

    def reading(self, now: Ns, presses: tuple[Intent, ...] = ()) -> StickReading:
        """As of any stick source; without fresh positions the pilot is lost."""
        if not self.fresh(now):
            return StickReading(present=False, at_rest=False, presses=presses)
        sticks = self._sticks if self._at_rest_once else CENTRED
        return StickReading(
            sticks=sticks._replace(tilt=self.tilt or sticks.tilt, gripper=self.gripper),
            at_rest=self._sticks.at_rest,
            age_ms=self.age_ns(now) / 1e6,
            presses=presses,
        )
