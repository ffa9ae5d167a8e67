"""Which of the many messages that repeat a value bring a new one, and when it was measured.

ArduSub takes over what its depth sensor and its compass have measured ten times a second
(`update_altitude`, `update_batt_compass`), sends the same value until the next time, and stamps it
when it is sent: at 1 m/s as much as 0.1 m late. A new value was taken over between the last message
with the old one and this one; it is the mean since the time before (`AP_Baro_MS56XX::update`,
`AP_Compass_Backend::drain_accumulated_samples`), so half of a period older.
"""

from collections.abc import Hashable
from dataclasses import dataclass

from messages.units import Ns

PERIOD_NS = 100_000_000  # [ns] between two values


@dataclass(slots=True)
class BoardUpdates:
    """Of one sensor."""

    age_ns: Ns  # of a value that has just been taken over
    same_ns: Ns  # a value that stays for longer is passed on: it was measured again, or is frozen
    _value: Hashable = None
    _sent_ns: Ns = 0  # stamp of the newest message
    _used_ns: Ns = 0  # … of the newest that brought something

    def measured_at(self, value: Hashable, sent_ns: Ns) -> Ns | None:
        """[ns] Middle of the time over which the value was measured; None: nothing new.

        Args:
            sent_ns: stamp of the message, which rises.
        """
        before, previous_ns = self._value, self._sent_ns
        self._value, self._sent_ns = value, sent_ns
        if value == before and sent_ns - self._used_ns < self.same_ns:
            return None
        self._used_ns = sent_ns
        if before is None or value == before:
            return sent_ns - self.age_ns
        return sent_ns - self.age_ns - min(sent_ns - previous_ns, PERIOD_NS) // 2
