"""Does a sensor repeat one value more often than its noise allows?

A value rounded to steps q, with normal noise σ, is the same value again with a probability of at
most p = erf(q / (2 √2 σ)): that of a truth in the middle of a step. So n samples in a row are all
the same with a probability of at most p^(n - 1). The rule follows from the sensor: one without
rounding hardly ever repeats a value; one whose step is much coarser than its noise may repeat it
for ever, and is not called frozen.

q is the smallest change ever seen. σ is as declared, or the least ever measured if that is less,
because a data sheet's "precision" is rarely the noise of one sample. Before the first measurement
of it, only a repetition for long counts.
"""

from math import ceil, erf, inf, log, sqrt

IMPOSSIBLE = 1e-9  # [-] probability: frozen
UNLIKELY = 1e-3  # [-] probability: the samples say nothing new and are not used
LEAST = 0.5  # [s] a driver may repeat the newest value of a slower sensor for as long
BLOCK = 100  # changes and repeats together, from which σ is measured
ONE = 1.5  # [steps] a smaller change is one of a single step


class FrozenWatch:
    """Of one number. Frozen from the sample that makes the run impossible until the value changes.
    While σ is not yet measured, it may repeat a value for `longest` seconds."""

    __slots__ = (
        "_count",
        "_long",
        "_longest_ns",
        "_measured",
        "_newest",
        "_repeats",
        "_short",
        "_since_ns",
        "_std",
        "_step",
        "_sum",
        "frozen",
        "redundant",
    )

    def __init__(self, std: float, longest: float) -> None:
        """Declared noise `std` in the sensor's unit, `longest` in [s]."""
        self.frozen = False
        self.redundant = False  # the newest sample says nothing new
        self._std, self._step, self._measured = std, inf, inf
        self._longest_ns = round(longest * 1e9)
        self._short = self._long = inf  # samples in a row that are unlikely and impossible
        self._newest: float | None = None
        self._since_ns = self._repeats = self._count = 0
        self._sum = 0.0  # squared changes in this block

    def step(self, value: float, stamp_ns: int) -> None:
        before, self._newest = self._newest, value
        if before is None or value != before:
            if before is not None:
                self._learn(abs(value - before))
            self._since_ns, self._repeats = stamp_ns, 0
            self.frozen = self.redundant = False
            return
        self._repeats += 1
        samples, lasted_ns = self._repeats + 1, stamp_ns - self._since_ns
        self.redundant = samples >= self._short
        if self._measured == inf:
            self.frozen = lasted_ns >= self._longest_ns
        else:
            self.frozen = samples >= self._long and lasted_ns >= LEAST * 1e9

    def _learn(self, change: float) -> None:
        """A run has ended with this change: a single step, or the run was not of a fault."""
        self._step = min(self._step, change)
        if not self.frozen or change < ONE * self._step:
            self._count += 1 + self._repeats
            self._sum += change * change
        if self._count >= BLOCK:  # a difference has the variance 2 σ²
            self._measured = min(self._measured, sqrt(self._sum / (2 * self._count)))
            self._count, self._sum = 0, 0.0
            std = min(self._std, self._measured)
            self._short = in_a_row(self._step, std, UNLIKELY)
            self._long = in_a_row(self._step, std, IMPOSSIBLE)


def in_a_row(step: float, std: float, probability: float) -> float:
    """[-] Identical samples in a row that are less likely than `probability`, for a value rounded
    to `step` with noise `std` in the same unit; infinity: they never are."""
    same = erf(step / (2.0 * sqrt(2.0) * std)) if std > 0.0 else 1.0
    if same >= 1.0:
        return inf
    if same <= 0.0:
        return 2
    return max(2, 1 + ceil(log(probability) / log(same)))
