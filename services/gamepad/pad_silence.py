"""Whether a pad that is still plugged in has stopped answering. Pure.

A Bluetooth pad whose radio link breaks stays "connected" until the link's supervision timeout ends,
20 s by default, and all the while its last stick positions are repeated as if a hand held them. SDL
and evdev report only changes, so most of the time such a pad looks like one that is held still. Two
things can be known nevertheless:

- A stick that is deflected, but not against its stop, is held by a hand, and no hand holds a stick
  on one and the same count. Where none of the pad's controls changes for `silent_after`, the pad is
  lost.
- Many pads send reports all the time, also with still sticks. The kernel passes their raw reports
  on (hidraw). Where a pad was seen to do so, the pad is lost as soon as they end.

What cannot be seen without raw reports: that a pad has stopped answering with centred sticks, which
moves nothing; and with a stick against its stop, where a hand that presses does not move it either.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from messages.units import Ns

STICKS = (("leftx", "lefty"), ("rightx", "righty"))
STOP = 0.9  # [-] from this deflection on a stick may lean against its stop
PAUSE_NS = 100_000_000  # [ns] longest pause of a pad that sends reports all the time
PROOF_NS = 10_000_000_000  # [ns] of reports without such a pause, with still sticks, prove it
BEAT_NS = 1_000_000_000  # [ns] without a report after which such a pad is lost


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
    _answered_at: Ns | None = None
    _beats_since: Ns = 0  # when the reports began that came without a pause, with still sticks
    _beats: bool = False  # it sends reports all the time

    def read(self, controls: Mapping[str, float], reported: bool, now: Ns) -> PadAnswer:
        """
        Args:
            controls: the pad's state in SDL's names.
            reported: a raw report has arrived since the last reading.
            now: [ns]
        """
        changed = controls != self._before
        if changed or self._answered_at is None:
            self._before = dict(controls)
            self._beats_since = now
        if reported:
            self._beat(now)
        if changed or reported or self._answered_at is None:
            self._answered_at = now
        age_ns = now - self._answered_at
        if self._beats and age_ns >= BEAT_NS:
            return PadAnswer(age_ns, lost=True)
        if held_by_a_hand(controls, self.dead_band) and age_ns >= self.silent_after * 1e9:
            return PadAnswer(age_ns, lost=True)
        return PadAnswer(age_ns if self._beats else 0)

    def _beat(self, now: Ns) -> None:
        if self._answered_at is not None and now - self._answered_at > PAUSE_NS:
            self._beats_since = now
        self._beats = self._beats or now - self._beats_since >= PROOF_NS


def held_by_a_hand(controls: Mapping[str, float], dead_band: float) -> bool:
    """Is a stick deflected so that only a hand can hold it there, freely?"""
    for names in STICKS:
        x, y = (abs(controls.get(name, 0.0)) for name in names)
        if max(x, y) > dead_band and x * x + y * y < STOP * STOP:
            return True
    return False
