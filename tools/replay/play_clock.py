"""Where a replay is in its recording. Pure: the real time is an argument."""

from messages.units import Ns


class PlayClock:
    """Maps real time to recorded time, both in ns: at a speed, with pauses and jumps.

    `due(position(now)) == now` while it plays, so that a message's age on the bus is the one that
    was recorded.
    """

    def __init__(self, begin: Ns, end: Ns, speed: float, now: Ns) -> None:
        """
        Args:
            begin, end: recorded times between which it plays.
            speed: [-] recorded seconds per second; more than 0.
        """
        self.begin, self.end, self.speed = begin, end, speed
        self.playing = True
        self._at, self._since = begin, now  # position at the last change, and when that was

    def position(self, now: Ns) -> Ns:
        """Recorded time, at most the end."""
        gone = round((now - self._since) * self.speed) if self.playing else 0
        return min(self.end, self._at + gone)

    def due(self, recorded: Ns) -> Ns:
        """When a recorded time is reached, at the present speed."""
        return self._since + round((recorded - self._at) / self.speed)

    def over(self, now: Ns) -> bool:
        return self.position(now) >= self.end

    def toggle(self, now: Ns) -> None:
        """Pause, or go on."""
        self.jump(self.position(now), now)
        self.playing = not self.playing

    def jump(self, to: Ns, now: Ns) -> None:
        """Go on from another recorded time, within the limits."""
        self._at, self._since = min(self.end, max(self.begin, to)), now
