"""What every page is shown: the vehicle, and what only a page shows of it."""

from collections.abc import Sequence

from messages import topics
from messages.control import ThrusterCommand
from messages.pilot import PilotCommand
from messages.units import Ns
from services.vehicle_view import ages
from services.vehicle_view.view import VehicleView
from services.vehicle_view.words import Tone

# [ms] of its age table: old from when on, and not shown from when on. The page ages what it has
# while nothing arrives, and adds the way to the browser.
AGES_MS = {
    name: (table.grey_ns / 1e6, table.gone_ns / 1e6)
    for name, table in (("state", ages.STATE), ("picture", ages.PICTURE), ("drones", ages.DRONES))
}


class PageView(VehicleView, frozen=True, kw_only=True, omit_defaults=True):
    """One picture of the drone."""

    drone: str = ""  # its name
    said: tuple[tuple[str, Tone], ...] = ()  # sentences, the gravest first
    numbers: tuple[tuple[str, str], ...] = ()  # (label, text)
    thrust: tuple[float, ...] = ()  # [-] share of each thruster's most, signed
    sticks: tuple[float, ...] = ()  # [-] surge, sway, heave, yaw as sent to the drone
    filming_s: float | None = None  # [s] that a film runs; None: none does
    snapshots: int = 0  # that were taken
    change: str = ""  # of drone: what has become of the newest order to fly another one
    lines: tuple[tuple[str, str], ...] = ()  # (level, text), the newest last


def positions(command: PilotCommand | None, now: Ns) -> tuple[float, ...]:
    """Of the command that was sent last; none once it does not act any more."""
    if command is None or now > command.stamp_ns + command.ttl_ms * 1e6:
        return ()
    return command.surge, command.sway, command.heave, command.yaw


def thrust(
    command: ThrusterCommand | None, limits: Sequence[tuple[float, float]], now: Ns
) -> tuple[float, ...]:
    """
    Args:
        limits: [N] least and most thrust of each thruster.
    """
    command = ages.shown(topics.THRUSTERS, command, now)
    if command is None:
        return ()
    shares = zip(command.thrust, limits, strict=False)
    return tuple(round(n / (most if n > 0.0 else -least), 2) for n, (least, most) in shares)
