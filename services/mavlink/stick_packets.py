"""Stick positions in MANUAL_CONTROL and RC_CHANNELS_OVERRIDE."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from messages.units import Ns
from services.mavlink_io.numbers import NO_AXIS, NO_CHANNEL
from services.piloting.guest_pilot import TTL_NS
from services.piloting.sticks import Sticks

# [-] so close to the middle a stick counts as centred: pads of ground stations rest beside it, and
# the drone arms with centred sticks only.
DEAD_BAND = 0.03
HALF = 400.0  # [µs] from the middle of a channel to full stick
MIDDLE = 1500.0  # [µs]
DARK, RANGE = 1100.0, 800.0  # [µs] channel of the lights: off, and from there to full brightness
# ArduSub's channels, counted from 1 (ArduSub/radio.cpp).
HEAVE, YAW, SURGE, SWAY, TILT, LIGHT = 3, 4, 5, 6, 8, 9
MOVING = (HEAVE, YAW, SURGE, SWAY)
READ = (*MOVING, TILT, LIGHT)


class StickPacket(NamedTuple):
    """What one packet says."""

    sticks: Sticks
    clipped: bool  # a value was beyond full stick
    light: float | None = None  # [-] 0 … 1; None: it says none
    moves: bool = True  # it says something of the sticks


def manual_control(fields: Mapping[str, Any], gain: float) -> StickPacket:
    """x forward, y right, r clockwise: -1000 … 1000; z upwards: 0 … 1000 with 500 in the middle.
    An axis that is not there is centred.

    Args:
        gain: [-] command at full stick.
    """
    travels = [
        _travel(fields["x"], 0.0, 1000.0),
        _travel(fields["y"], 0.0, 1000.0),
        -_travel(fields["z"], 500.0, 500.0),
        _travel(fields["r"], 0.0, 1000.0),
    ]
    surge, sway, heave, yaw = (gain * _shaped(travel) for travel in travels)
    return StickPacket(Sticks(surge, sway, heave, yaw), any(abs(travel) > 1 for travel in travels))


@dataclass(slots=True)
class Channels:
    """What one ground station has said of each channel with RC_CHANNELS_OVERRIDE: 1100 … 1900 µs. A
    channel that a packet ignores (65535; beyond channel 8 also 0) stays as it was, for as long as
    any stick position counts; one that is released (0; beyond channel 8 65534) is centred."""

    _said: dict[int, tuple[float, Ns]] = field(default_factory=dict[int, tuple[float, Ns]])

    def hear(self, fields: Mapping[str, Any], now: Ns) -> StickPacket | None:
        """None: no channel is known."""
        for number in READ:
            raw = fields[f"chan{number}_raw"]
            if raw == (0 if number <= 8 else NO_CHANNEL - 1):
                self._said.pop(number, None)
            elif raw not in (0, NO_CHANNEL):
                self._said[number] = float(raw), now
        known = {n: us for n, (us, at) in self._said.items() if now - at <= TTL_NS}
        if not known:
            return None
        travel = {n: (known.get(n, MIDDLE) - MIDDLE) / HALF for n in READ}
        sticks = Sticks(
            surge=_shaped(travel[SURGE]),
            sway=_shaped(travel[SWAY]),
            heave=-_shaped(travel[HEAVE]),
            yaw=_shaped(travel[YAW]),
            tilt=_shaped(travel[TILT]),
        )
        lamp = known.get(LIGHT)
        light = None if lamp is None else min(1.0, max(0.0, (lamp - DARK) / RANGE))
        clipped = any(abs(travel[n]) > 1 for n in READ)
        return StickPacket(sticks, clipped, light, moves=not known.keys().isdisjoint(MOVING))

    def tilt(self, now: Ns) -> float:
        """[-] Of the camera, beside MANUAL_CONTROL, which has none."""
        us, at = self._said.get(TILT, (MIDDLE, now))
        return _shaped((us - MIDDLE) / HALF) if now - at <= TTL_NS else 0.0


def lets_go(fields: Mapping[str, Any]) -> bool:
    """Whether a packet releases all sticks."""
    return all(fields[f"chan{number}_raw"] == 0 for number in (*MOVING, TILT))


def _travel(raw: int, middle: float, half: float) -> float:
    return 0.0 if raw == NO_AXIS else (raw - middle) / half


def _shaped(travel: float) -> float:
    """Clipped to ±1, 0 around the middle, and continuous."""
    beyond = (min(abs(travel), 1.0) - DEAD_BAND) / (1.0 - DEAD_BAND)
    return 0.0 if beyond <= 0.0 else beyond if travel > 0.0 else -beyond
