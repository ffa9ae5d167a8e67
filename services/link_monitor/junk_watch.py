"""Floods of messages that services cannot read, by their health.

Gates refuse and count such messages, and nothing comes of a single one: a link damages some. So
many in a second that they are no accident are said to the pilot. Not those of sensors: a broken one
sends numbers that are none, and the drone says so itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from messages import events
from messages.health import Health
from messages.units import Ns

UNREADABLE = (
    *(events.MALFORMED.name, events.WRONG_TYPE.name, events.OVERSIZED.name),
    *(events.UNKNOWN_KEY.name, events.TOO_MANY_KEYS.name),
)  # kinds of events
MOST_HZ = 20.0  # [1/s] unreadable messages of one service; more is a flood
RECENT_NS = 3_000_000_000  # [ns] of health messages, of one a second
SERVICES = 64  # services that are watched

Key = tuple[str, str, int]  # side, service, its process: two topsides may watch one drone


class Heard(NamedTuple):
    at_ns: Ns
    unreadable: Mapping[str, int]  # by name, since the service's start


@dataclass(slots=True)
class JunkWatch:
    """Takes health messages; `words` is what the pilot should read."""

    _heard: dict[Key, Heard] = field(default_factory=dict[Key, Heard])
    _flooded: dict[Key, tuple[Ns, str]] = field(default_factory=dict[Key, tuple[Ns, str]])

    def health(self, health: Health, now: Ns) -> None:
        key = health.side, health.service, health.instance
        before = self._heard.get(key)
        if before is None and len(self._heard) >= SERVICES:
            self._heard = {k: h for k, h in self._heard.items() if now - h.at_ns < RECENT_NS}
            if len(self._heard) >= SERVICES:
                return
        counts = {name: count for name, count in health.counts.items() if _unreadable(name)}
        self._heard[key] = Heard(now, counts)
        if before is None or now <= before.at_ns:
            return
        more = {name: count - before.unreadable.get(name, 0) for name, count in counts.items()}
        per_second = sum(more.values()) / ((now - before.at_ns) / 1e9)
        if per_second > MOST_HZ:
            worst = max(more, key=lambda name: more[name]).partition(":")[2]
            what = f"{health.service} cannot read {per_second:.0f} messages a second ({worst} …)"
            self._flooded[key] = now, what

    def words(self, now: Ns) -> str:
        """Of the service that was flooded first; empty: none is."""
        self._flooded = {k: v for k, v in self._flooded.items() if now - v[0] < RECENT_NS}
        if not self._flooded:
            return ""
        _, what = next(iter(self._flooded.values()))
        return f"{what}: somebody else speaks on this network, or the sender is broken"


def _unreadable(name: str) -> bool:
    kind, _, key = name.partition(":")
    return kind in UNREADABLE and not key.startswith("sensor/")
