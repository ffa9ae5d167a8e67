"""Which messages a link gets by itself, and how often."""

from dataclasses import dataclass, field

from messages.units import Ns
from services.mavlink.telemetry import MADE
from services.mavlink_io.numbers import MavDataStream

HIGHEST_HZ = 50.0  # nothing is sent more often
OFF: Ns = 0
DEFAULT_HZ = {
    "HEARTBEAT": 1.0,
    "SYS_STATUS": 2.0,
    "SYSTEM_TIME": 1.0,
    "ATTITUDE": 20.0,
    "LOCAL_POSITION_NED": 5.0,
    "GLOBAL_POSITION_INT": 5.0,
    "VFR_HUD": 10.0,
    "BATTERY_STATUS": 1.0,
    "AHRS2": 5.0,
    "HOME_POSITION": 0.0,
    "EXTENDED_SYS_STATE": 1.0,
    "NAMED_VALUE_FLOAT": 2.0,
}
# What a stream of REQUEST_DATA_STREAM consists of. The others are of nothing that is sent here.
STREAMS: dict[int, tuple[str, ...]] = {
    MavDataStream.EXTENDED_STATUS: ("SYS_STATUS", "NAMED_VALUE_FLOAT"),
    MavDataStream.POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    MavDataStream.EXTRA1: ("ATTITUDE", "AHRS2"),
    MavDataStream.EXTRA2: ("VFR_HUD",),
    MavDataStream.EXTRA3: ("BATTERY_STATUS", "SYSTEM_TIME"),
}
STREAMS[MavDataStream.ALL] = tuple(name for names in STREAMS.values() for name in names)


def period_ns(hz: float) -> Ns:
    """[ns] 0: never."""
    return OFF if not hz > 0.0 else round(1e9 / min(hz, HIGHEST_HZ))


@dataclass(slots=True)
class LinkStreams:
    """Of one link."""

    _periods: dict[str, Ns] = field(
        default_factory=lambda: {name: period_ns(hz) for name, hz in DEFAULT_HZ.items()}
    )
    _due: dict[str, Ns] = field(default_factory=lambda: dict.fromkeys(MADE, 0))

    def due(self, now: Ns) -> list[str]:
        """Names of the messages to send now. What is late is not sent twice."""
        names = [n for n, p in self._periods.items() if p != OFF and self._due[n] <= now]
        for name in names:
            period = self._periods[name]
            self._due[name] = max(self._due[name] + period, now + period // 2)
        return names

    def every(self, name: str, period: Ns, now: Ns) -> None:
        """Send it this often from now on; `OFF`: never. A heartbeat is never off."""
        if name == "HEARTBEAT" and period == OFF:
            return
        shortest = period_ns(HIGHEST_HZ)
        self._periods[name] = OFF if period == OFF else max(shortest, period)
        self._due[name] = now

    def period(self, name: str) -> Ns:
        return self._periods[name]
