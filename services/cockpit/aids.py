"""Figures that help to fly and that need the past: how long the dive has gone on, and how long the
battery lasts. Pure."""

from collections import deque
from dataclasses import dataclass, field

from messages.sensors import BatterySample
from messages.units import Ns
from messages.vehicle import VehicleStatus

SPAN_NS = 180_000_000_000  # [ns] of the past by which the battery's use is judged
LEAST_NS = 30_000_000_000  # [ns] of it, before anything is said
LONGEST_MIN = 600.0  # [min] more is not said: the drone hardly uses anything


@dataclass(slots=True)
class DiveTimer:
    """Since the drone was first seen armed."""

    began_ns: Ns | None = None

    def heard(self, status: VehicleStatus, now: Ns) -> None:
        if status.armed and self.began_ns is None:
            self.began_ns = now

    def seconds(self, now: Ns) -> float | None:
        """[s]"""
        return None if self.began_ns is None else round((now - self.began_ns) / 1e9)


@dataclass(slots=True)
class Endurance:
    """How long the battery lasts at the mean power of the last minutes."""

    _used: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[Ns, float]])  # [ns], [Wh]

    def heard(self, battery: BatterySample | None) -> None:
        """The newest sample, as often as anybody likes."""
        used = self._used
        if battery is None or battery.used_wh is None:
            return
        if used and battery.stamp_ns == used[-1][0]:
            return
        if used and (battery.stamp_ns < used[-1][0] or battery.used_wh < used[-1][1]):
            used.clear()  # another battery, or another clock
        used.append((battery.stamp_ns, battery.used_wh))
        while used[0][0] < battery.stamp_ns - SPAN_NS:
            used.popleft()

    def minutes(self, battery: BatterySample | None) -> float | None:
        """[min] None: not known, because its capacity is not, or the past is too short."""
        if battery is None or battery.charge is None or battery.capacity_wh is None:
            return None
        (began_ns, before), (ends_ns, after) = self._used[0], self._used[-1]
        if ends_ns < began_ns + LEAST_NS or after <= before:
            return None
        left = max(0.0, battery.charge) * battery.capacity_wh  # [Wh]
        minutes = left * (ends_ns - began_ns) / 60e9 / (after - before)
        return round(minutes) if minutes <= LONGEST_MIN else None
