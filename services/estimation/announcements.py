"""What the pilot is told at once: a sensor that the state lacks, and when it is back."""

from messages.counts import Rank, meaning, sentence
from services.estimation.events import Events


class Announcements:
    """`events` gets a name to count and a line for the log."""

    def __init__(self, events: Events) -> None:
        self._events = events
        self._lacks = {"imu": False, "pressure": False}
        self._frozen: tuple[str, ...] = ()

    def see(self, *, imu: bool, pressure: bool) -> None:
        """Whether each sensor is used now."""
        for sensor, used in (("imu", imu), ("pressure", pressure)):
            if used == self._lacks[sensor]:
                self._lacks[sensor] = not used
                self.tell(f"regained:sensor/{sensor}" if used else f"lost:sensor/{sensor}")

    def see_frozen(self, frozen: tuple[str, ...]) -> None:
        """The names, already counted, of the sensors that are frozen now."""
        for name in frozen:
            if name not in self._frozen:
                self._say(name)
        self._frozen = frozen

    def tell(self, name: str | None) -> None:
        """Count a name, and say in words what the pilot has to know of."""
        if name is None:
            return
        self._events.note(name)
        if name in TOLD:
            self._say(name)

    def _say(self, name: str) -> None:
        rank, words = meaning(name)[0], sentence(name)
        (self._events.warn if rank is Rank.DANGER else self._events.say)(words)


TOLD = {
    "lost:sensor/imu",
    "lost:sensor/pressure",
    "regained:sensor/imu",
    "regained:sensor/pressure",
    "distrusted:sensor/imu",
    "trusted:sensor/imu",
    "jumped:sensor/pressure",
    "restarted:depth",
    "inconsistent:sensor/pressure",
    "doubted:gyroscope",
    "stepped:gyroscope",
    "trusted:gyroscope",
    "found:heading",
}
