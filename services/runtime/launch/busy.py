"""Is this computer too busy for a dive? Said once, where each service has its own to say. Pure."""

from collections import deque

from messages.health import LATE_MS, Health

WITHIN_NS = 10_000_000_000  # [ns]
MOST, SERVICES = 10, 4  # late reports within that time, and services that they are of


class Busyness:
    """Of the services of one computer."""

    def __init__(self) -> None:
        self._late: deque[tuple[int, str]] = deque()  # when, and which service
        self._said = False

    def see(self, health: Health, now: int, advice: str) -> str | None:
        """Returns the sentence when it is to be said."""
        late = health.lateness_p99_ms
        if self._said or late is None or late <= LATE_MS:
            return None
        self._late.append((now, health.service))
        while now - self._late[0][0] > WITHIN_NS:
            self._late.popleft()
        services = {service for _, service in self._late}
        if len(self._late) < MOST or len(services) < SERVICES:
            return None
        self._said = True
        return (
            f"this computer is too busy for a dive: {len(services)} late services in "
            f"{WITHIN_NS // 10**9} s; try {advice}"
        )
