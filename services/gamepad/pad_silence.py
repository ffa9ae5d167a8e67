"""Whether a pad that is still plugged in has stopped answering. Pure.

A Bluetooth pad whose radio link breaks stays "connected" until the link's supervision timeout ends,
20 s by default, and all the while its last stick positions are repeated as if a hand held them. SDL
and evdev report only changes, so most of the time such a pad looks like one that is held still. One
thing can be known nevertheless: a stick that is deflected, but not against its stop, is held by a
hand, and no hand holds a stick on one and the same count. Where none of the pad's controls changes
for `silent_after`, the pad is lost.

What cannot be seen: that a pad has stopped answering with centred sticks, which moves nothing; and
with a stick against its stop, where a hand that presses does not move it either.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from messages.units import Ns

STICKS = (("leftx", "lefty"), ("rightx", "righty"))
STOP = 0.9  # [-] from this deflection on a stick may lean against its stop


class PadAnswer(NamedTuple):
    """What is known of a pad that is plugged in."""

    age_ns: Ns = 0  # [ns] since it last answered; 0 also where its silence means nothing
    lost: bool = False


@dataclass(slots=True)
class PadSilence:
    """Of one pad, from when it was plugged in."""

    silent_after: float  # [s]
    dead_band: float  # [-]
    _before: dict[str, float] = field(default_factory=dict[str, float])
    _changed_at: Ns | None = None

    def read(self, controls: Mapping[str, float], now: Ns) -> PadAnswer:
        """`controls`: the pad's state in SDL's names, at `now` [ns]."""
        if controls != self._before or self._changed_at is None:
            self._before, self._changed_at = dict(controls), now
        age_ns = now - self._changed_at
        if age_ns >= self.silent_after * 1e9 and held_by_a_hand(controls, self.dead_band):
            return PadAnswer(age_ns, lost=True)
        return PadAnswer()


def held_by_a_hand(controls: Mapping[str, float], dead_band: float) -> bool:
    """Is a stick deflected so that only a hand can hold it there, freely?"""
    for names in STICKS:
        x, y = (abs(controls.get(name, 0.0)) for name in names)
        if max(x, y) > dead_band and x * x + y * y < STOP * STOP:
            return True
    return False
