"""What a pilot must see of the drone, from the newest messages. Pure: shared by the status screen
in the terminal and the window of the keyboard."""

import math
from dataclasses import dataclass

from messages.link import Clock, LatencyBudget, LinkStatus
from messages.reference import Reference
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.topic import M
from messages.units import Ns
from messages.vehicle import VehicleStatus

RECENT_NS = 3_000_000_000  # [ns] an older state or reference is not shown
STATUS_S = 1.5  # [s] a status is repeated five times a second


@dataclass(frozen=True, slots=True, kw_only=True)
class PilotView:
    """In the pilot's units. Unknown is None."""

    mode: str = "starting"
    hold: str = ""  # what the drone holds by itself
    light: float | None = None  # [-] 0 … 1
    battery_v: float | None = None  # [V]
    used_wh: float | None = None  # [Wh] since power-on
    capacity_wh: float | None = None  # [Wh] when full
    armed: bool = False
    last_known: bool = False  # no status arrives: armed, mode and failsafe are those of the last
    failsafe: str = "none"
    since_s: float | None = None  # [s] since its condition began
    next_s: float | None = None  # [s] until the next reaction begins
    words: str = ""  # what has happened, what the drone does and what ends it
    note: str = ""
    age_ms: float | None = None  # [ms] of depth and heading
    depth_m: float | None = None
    depth_wanted_m: float | None = None
    heading_deg: float | None = None  # [0, 360)
    heading_wanted_deg: float | None = None
    rtt_ms: float | None = None
    alarm: str = ""  # what is wrong with the link


def pilot_view(
    now: Ns,
    *,
    status: VehicleStatus | None,
    state: VehicleState | None,
    reference: Reference | None,
    battery: BatterySample | None,
    link: LinkStatus | None,
    clock: Clock | None,
    budget: LatencyBudget | None,
    note: str = "",
) -> PilotView:
    """
    Args:
        now: [ns]
        status, state, reference: the newest that ever arrived.
        battery, link, clock, budget: None where there is none that is fresh.
        note: where there is no status.
    """
    state, reference = recent(state, now), recent(reference, now)
    silence = _silence(status, now) if status else ""
    heard = None if silence else status
    return PilotView(
        mode=status.mode if status else "starting",
        hold=heard.hold if heard else "",
        light=heard.light if heard else None,
        battery_v=battery.voltage if battery else None,
        used_wh=battery.used_wh if battery else None,
        capacity_wh=battery.capacity_wh if battery else None,
        armed=status.armed if status else False,
        last_known=bool(silence),
        failsafe=status.failsafe if status else "none",
        since_s=_seconds(heard.since_ns, now) if heard else None,
        next_s=_seconds(now, heard.next_ns) if heard else None,
        words=status.words if status else "",
        note=silence or (status.note if status else note),
        age_ms=(now - state.stamp_ns) / 1e6 if state else None,
        depth_m=state.depth.value if state and state.depth.valid else None,
        depth_wanted_m=reference.depth.position if reference else None,
        heading_deg=_compass(state.heading.value) if state and state.heading.valid else None,
        heading_wanted_deg=_compass(reference.heading.position) if reference else None,
        rtt_ms=clock.rtt_ms if clock else link.rtt_ms if link else None,
        alarm=budget.alarm if budget else "",
    )


def recent(message: M | None, now: Ns) -> M | None:
    """A message, even over a slow link; None once it is older than `RECENT_NS`."""
    return message if message is not None and now - message.stamp_ns <= RECENT_NS else None


def _seconds(since_ns: Ns | None, until_ns: Ns | None) -> float | None:
    """[s] From one instant to another."""
    return None if since_ns is None or until_ns is None else (until_ns - since_ns) / 1e9


def _silence(status: VehicleStatus, now: Ns) -> str:
    """That what is shown of the vehicle's mode is old; nothing while it is not."""
    age_s = (now - status.stamp_ns) / 1e9
    return "" if age_s <= STATUS_S else f"no status from the drone for {age_s:.0f} s"


def _compass(heading: float) -> float:
    """[deg] From a heading in radians that accumulates, as it is shown: 0.0 … 359.9."""
    return round(math.degrees(heading), 1) % 360.0  # rounded first: 359.96 is 0.0, not 360.0
