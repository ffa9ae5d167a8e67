"""How many messages a page may send: one that floods is closed."""

import time

MOST_PER_SECOND = 250  # [1/s] a page sends 50 to 125 sticks, 25 confirmations, and one per picture


class MessageRate:
    """Of one page."""

    def __init__(self) -> None:
        self._second, self._heard = 0, 0

    def too_many(self) -> bool:
        """One more has arrived. Were there too many within this second?"""
        now = int(time.monotonic())
        self._second, self._heard = now, self._heard + 1 if now == self._second else 1
        return self._heard > MOST_PER_SECOND
