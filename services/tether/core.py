"""The link as a whole: both directions, changes, telemetry rate control and the status."""

from typing import Generic, TypeVar

import numpy as np

from messages.link import Clock, LinkStatus
from services.tether.link_model import LinkDirection
from services.tether.profile import LinkProfile
from services.tether.telemetry_rate_control import TelemetryRateControl

T = TypeVar("T")


class Link(Generic[T]):
    """Messages of any type, down and up."""

    def __init__(self, name: str, profile: LinkProfile, seed: int) -> None:
        self.name = name
        self.down: LinkDirection[T] = LinkDirection(profile.down, np.random.default_rng(seed))
        self.up: LinkDirection[T] = LinkDirection(profile.up, np.random.default_rng(seed + 1))
        self.changes = 0  # since start
        self._profile = profile
        self._rate_control = TelemetryRateControl()
        self._judged = (0, 0)  # bytes carried, and the time that took [ns], until then
        self._begin()

    # Changes.

    def change(self, name: str, profile: LinkProfile, now: int) -> None:
        """Use another model from now on; messages on the link still arrive."""
        self.changes += 1
        self.name, self._profile = name, profile
        self.down.change(profile.down, now)
        self.up.change(profile.up, now)
        self._begin()

    def cut(self, now: int) -> None:
        """Lose every message on the link, and every message that enters until `restore`."""
        self.changes += 1
        self.down.cut(now)
        self.up.cut(now)

    def restore(self, now: int) -> None:
        self.changes += 1
        self.down.restore(now)
        self.up.restore(now)

    # Telemetry rate control.

    def admits_up(self, key: str, size: int, now: int) -> bool:
        """May this message of `size` bytes go up, or is its topic thinned out?"""
        return self._rate_control.admits(key, size + self._profile.up.overhead_bytes, now)

    def judge(self, now: int) -> bool:
        """Check the upward direction since the last call. True: the rates have changed."""
        carried, busy = self._judged
        self._judged = (self.up.carried_bytes, self.up.busy_ns)
        if not self._thins:
            return False
        took = self.up.busy_ns - busy
        carries = (self.up.carried_bytes - carried) * 8e6 / took if took > 0 else None
        return self._rate_control.judge(carries, now)

    def _begin(self) -> None:
        """Another model is in force."""
        self._rate_control.rates = {}
        if self._thins:
            self._rate_control.begin()

    @property
    def _thins(self) -> bool:
        return self._profile.thin and self._profile.up.rate_kbit > 0.0

    @property
    def thinned(self) -> dict[str, float]:
        """[1/s] Topics that are thinned out, and to what rate."""
        return self._rate_control.rates

    @property
    def telemetry(self) -> str:
        """The same in words."""
        rates = ", ".join(f"{key} {hz:.3g}/s" for key, hz in self.thinned.items())
        return f"telemetry thinned out to {rates}" if rates else "full telemetry"

    # Status.

    def status(self, now: int, clock: Clock | None) -> LinkStatus:
        """What passed since the last status; None where nothing is known."""
        down, up = self.down.report(now), self.up.report(now, dict(self.thinned))
        there = self.down.is_up(now) and self.up.is_up(now)
        one_way = down.delay_p50_ms, up.delay_p50_ms
        known = there and one_way[0] is not None and one_way[1] is not None
        return LinkStatus(
            stamp_ns=now,
            profile=self.name,
            up=there,
            down_link=down,
            up_link=up,
            rtt_ms=(one_way[0] or 0.0) + (one_way[1] or 0.0) if known else None,
            changes=self.changes,
            clock=clock,
        )
