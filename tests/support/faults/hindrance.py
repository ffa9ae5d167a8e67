"""What keeps a service on virtual time from being stepped: it is stopped, slow, or has too little
of a busy processor."""

from collections.abc import Callable

import numpy as np

from tests.support.jitter import Jitter, Lateness

FOR_EVER = 10**18  # [ns]
PUNCTUAL = Jitter()


class Hindrance(Lateness):
    """Of one service; without any it is stepped at the instant it is woken."""

    def __init__(self, clock: Callable[[], int], seed: int) -> None:
        """
        Args:
            clock: [ns] virtual time.
            seed: [-] of the delays of a busy processor.
        """
        super().__init__(PUNCTUAL, np.random.default_rng(seed))
        self._clock = clock
        self._free_ns = 0  # [ns] not stepped before
        self._pause_ns = 0  # [ns] taken by every step

    def stop(self) -> None:
        """As SIGSTOP does; arrivals wait in the ports."""
        self._free_ns = FOR_EVER

    @property
    def stopped(self) -> bool:
        return self._free_ns == FOR_EVER

    def go_on(self) -> None:
        """As SIGCONT does, and as a new process begins."""
        self._free_ns = self._pause_ns = 0
        self.share(PUNCTUAL)

    def slow(self, pause_s: float) -> None:
        """Every step takes so long [s]: what it publishes comes at its beginning, but nothing else
        is handled until its end."""
        self._pause_ns = round(1e9 * pause_s)

    def share(self, jitter: Jitter) -> None:
        """Delays and stalls from now on."""
        self._jitter = jitter

    def stepped(self) -> None:
        super().stepped()
        if self._pause_ns:
            self._free_ns = self._clock() + self._pause_ns

    def next_step(self, deadline: int) -> int:
        return max(super().next_step(deadline), self._free_ns)
