"""Is a sensor far noisier than it may be?

Judged by second differences x₀ - 2 x₁ + x₂, in which steady motion and acceleration have no share.
Those of white noise with the standard deviation σ have the variance 6 σ².
"""

BLOCK = 50  # second differences judged together


class NoiseWatch:
    """Noisy from a block beyond the limit until a block within it."""

    __slots__ = ("_after", "_before", "_count", "_most", "_sums", "noisy")

    def __init__(self, most: tuple[float, ...]) -> None:
        """`most`: 1σ of each number of a sample."""
        self.noisy = False
        self._most = [6.0 * BLOCK * limit * limit for limit in most]
        self._sums = [0.0] * len(most)
        self._count = 0
        self._before: tuple[float, ...] | None = None
        self._after: tuple[float, ...] | None = None

    def newly_noisy(self, content: tuple[float, ...]) -> bool:
        """Take in a sample. True when a block is too noisy after a good one."""
        first, middle = self._before, self._after
        self._before, self._after = middle, content
        if first is None or middle is None:
            return False
        sums = self._sums
        for i, value in enumerate(content):
            difference = first[i] - 2.0 * middle[i] + value
            sums[i] += difference * difference
        self._count += 1
        if self._count < BLOCK:
            return False
        was, self.noisy = self.noisy, any(map(float.__gt__, sums, self._most))
        self._sums, self._count = [0.0] * len(sums), 0
        return self.noisy and not was
