"""Virtual time on two machines: each side has its own clock."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil

from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.ports import Now


@dataclass(frozen=True, slots=True)
class Skew:
    """A machine's clock relative to the host's."""

    ahead_ns: int = 0  # [ns] at the beginning
    drift: float = 0.0  # [-] seconds gained per second

    def shows(self, host_ns: int) -> int:
        return host_ns + self.ahead_ns + round(self.drift * host_ns)

    def first_shows(self, local_ns: int) -> int:
        """[ns] Host time at which the clock reaches `local_ns`."""
        return ceil((local_ns - self.ahead_ns) / (1.0 + self.drift))


SAME = Skew()


class TwoClocks(VirtualHost):
    def __init__(self, clocks: Mapping[str, Skew] | None = None) -> None:
        """
        Args:
            clocks: clock of each side; None: they are one machine, with one clock.
        """
        super().__init__(apart=clocks is not None)
        self._clocks = clocks or {}

    def _deadline(self, name: str) -> int:
        home = next(iter(self.nodes[name].sides))
        return max(self.now, self._skew(home).first_shows(super()._deadline(name)))

    def _clock(self, home: str) -> Now:
        skew = self._skew(home)
        return lambda: skew.shows(self.now)

    def _skew(self, side: str) -> Skew:
        return self._clocks.get(side, SAME)
