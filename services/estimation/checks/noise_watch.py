"""Is a sensor far noisier than it may be?

Judged by second differences x₀ - 2 x₁ + x₂, in which steady motion and acceleration have no share.
Those of white noise with the standard deviation σ have the variance 6 σ².
"""

BLOCK = 50  # second differences judged together
MOST = 3.0  # [-] times its limit: a larger one counts as that, so that one jump is no noise
GOOD = 0.5  # [-] of the limit, to be used again


class NoiseWatch:
    """Noisy from a block beyond the limit until a block well within it."""

    __slots__ = ("_after", "_before", "_count", "_largest", "_most", "_sums", "noisy")

    def __init__(self, most: tuple[float, ...]) -> None:
        """`most`: 1σ of each number of a sample."""
        self.noisy = False
        variances = [6.0 * limit * limit for limit in most]
        self._most = [BLOCK * variance for variance in variances]
        self._largest = [MOST * MOST * variance for variance in variances]
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
        sums, largest = self._sums, self._largest
        for i, value in enumerate(content):
            difference = first[i] - 2.0 * middle[i] + value
            square = difference * difference
            sums[i] += square if square < largest[i] else largest[i]
        self._count += 1
        if self._count < BLOCK:
            return False
        was, share = self.noisy, GOOD * GOOD if self.noisy else 1.0
        self.noisy = any(total > share * most for total, most in zip(sums, self._most, strict=True))
        self._sums, self._count = [0.0] * len(sums), 0
        return self.noisy and not was
