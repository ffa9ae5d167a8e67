"""The link as a whole: both directions, changes, telemetry rate control and the status."""

from typing import Generic, TypeVar

import numpy as np

from messages.link import Clock, LinkStatus
from services.tether.link_model import LinkDirection
from services.tether.profile import LinkProfile
from services.tether.telemetry_rate_control import RateLadder, TelemetryRateControl, limits

T = TypeVar("T")

__all__ = ["Link", "LinkProfile"]


class Link(Generic[T]):
    """Messages of any type, down and up."""

    def __init__(self, name: str, profile: LinkProfile, seed: int) -> None:
        self.name = name
        self.down: LinkDirection[T] = LinkDirection(profile.down, np.random.default_rng(seed))
        self.up: LinkDirection[T] = LinkDirection(profile.up, np.random.default_rng(seed + 1))
        self.changes = 0  # since start
        self._profile = profile
        self._ladder = RateLadder()
        self._rate_control = TelemetryRateControl()
        self._judged = (0, 0, 0)  # [ns], bytes carried and messages lost in the queue, until then

    # Changes.

    def change(self, name: str, profile: LinkProfile, now: int) -> None:
        """Use another model from now on; messages on the link still arrive."""
        self.changes += 1
        faster = _carries_more(profile.up.rate_kbit, self._profile.up.rate_kbit)
        self.name, self._profile = name, profile
        self.down.change(profile.down, now)
        self.up.change(profile.up, now)
        if faster or not profile.thin:
            # The old link's capacity and losses do not apply to this one.
            self._ladder, self._rate_control.rates = RateLadder(), {}
            self._judged = (now, self.up.carried_bytes, self.up.lost_in_queue)

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
        before, carried, lost = self._judged
        seconds = (now - before) / 1e9
        standing, offered = self.up.standing_bytes(now), self._rate_control.offered(now)
        self._judged = (now, self.up.carried_bytes, self.up.lost_in_queue)
        if not self._profile.thin or seconds <= 0.0:
            return False
        kilobits = (self.up.carried_bytes - carried) * 8e-3 / seconds
        new = self.up.lost_in_queue - lost
        if not self._ladder.judge(standing, new, kilobits, offered, now):
            return False
        self._rate_control.rates = limits(self._ladder.level)
        return True

    @property
    def thinned(self) -> dict[str, float]:
        """[1/s] Topics that are thinned out, and to what rate."""
        return self._rate_control.rates

    @property
    def telemetry(self) -> str:
        """The same in words."""
        rates = ", ".join(f"{key} {hz:g}/s" for key, hz in self.thinned.items())
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


def _carries_more(rate_kbit: float, before_kbit: float) -> bool:
    """[kbit/s] 0 is no limit."""
    return rate_kbit == 0.0 or rate_kbit > before_kbit > 0.0
