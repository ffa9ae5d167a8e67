"""When things happen in a nominal dive, by the sensors' clock: samples, arming, sticks, the end.

The link is a pure delay, its declared mean. The pilot's program arms as soon as it sees that the
estimator runs, and the script begins when it sees the drone armed.
"""

from bisect import bisect_right
from typing import NamedTuple

from services.gamepad.stick_log import StickLog
from services.gamepad.stick_log_player import QUIET_NS
from services.piloting.sticks import CENTRED, Sticks
from services.simulator.settings import Settings
from services.tether.profile import LinkProfile
from tools.live.virtual_dive import STRIDE_NS

S = 1_000_000_000  # [ns]


class LinkDelays(NamedTuple):
    up_ns: int
    down_ns: int


def delays_of(link: LinkProfile) -> LinkDelays:
    up, down = link.up.declared_ms, link.down.declared_ms
    assert up is not None, "coverage.py refuses a trace"
    assert down is not None
    return LinkDelays(round(up * 1e6), round(down * 1e6))


def _behind(now: int) -> int:
    """[ns] By which sticks that need no time to cross arrive behind the step of their instant: at
    a whole second every service reports its health, and the chain is called before the pilot's."""
    return int(now % S == 0)


class SampleTimes(NamedTuple):
    """[ns] Between two samples."""

    imu: int
    pressure: int

    @classmethod
    def of(cls, settings: Settings) -> "SampleTimes":
        return cls(round(1e9 / settings.imu_rate), round(1e9 / settings.pressure_rate))

    def pressures(self, since: int, until: int) -> range:
        """[ns] Instants of pressure samples after `since`, not after `until`."""
        first, last = since // self.pressure + 1, until // self.pressure
        return range(first * self.pressure, last * self.pressure + 1, self.pressure)


class DiveTimes:
    """From the end of the calibration on."""

    def __init__(
        self, script: StickLog, link: LinkDelays, running_ns: int, seconds: float | None
    ) -> None:
        """
        Args:
            running_ns: [ns] of the first state that the pilot's program can arm.
            seconds: [s] after arming; None: to the script's end.
        """
        self._armed_ns = running_ns + link.up_ns + link.down_ns
        self.began_ns = self._armed_ns + link.up_ns
        disarms = self.began_ns + script.duration_ns + QUIET_NS
        self._disarmed_ns, ends = disarms + link.down_ns, disarms + link.down_ns + link.up_ns
        if seconds is not None:
            ends = min(ends, self.began_ns + round(seconds * 1e9))
        self.end_ns = -(-ends // STRIDE_NS) * STRIDE_NS
        self.changes = [(self.began_ns + row.at_ns, script.at(row.at_ns)) for row in script.rows]
        self._heard = [at + (link.down_ns or _behind(at)) for at, _ in self.changes]

    def armed(self, now: int) -> bool:
        """What was asked for at an instant acts from the next one on."""
        return self._armed_ns < now <= self._disarmed_ns

    def sticks(self, now: int) -> Sticks:
        """As the drone has heard them."""
        index = bisect_right(self._heard, now) - 1
        return self.changes[index][1].sticks if index >= 0 else CENTRED
