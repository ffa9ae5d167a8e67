"""Delay distributions of the link, each given by its quantile function, and the numbers that they
are drawn by: in blocks, a tenth of the cost of drawing one by one."""

from bisect import bisect_right
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BLOCK = 1024  # numbers drawn at once
LONGEST_MS = 60_000.0  # [ms] longest delay of a message
TAIL = 1e-9  # [-] a distribution ends at this quantile and its opposite: nothing is infinite
Milliseconds = Annotated[float, msgspec.Meta(ge=0.0, le=LONGEST_MS)]


class DelayDistribution(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of the distributions."""

    def quantile(self, share: Floats) -> Floats:
        """[ms] Delay that this share of the messages does not exceed; same shape as `share`."""
        raise NotImplementedError


class Exponential(DelayDistribution, frozen=True, tag="exponential"):
    """What `jitter_ms` of a profile adds."""

    mean_ms: Milliseconds  # [ms]

    def quantile(self, share: Floats) -> Floats:
        return -self.mean_ms * np.log1p(-share)


class Pareto(DelayDistribution, frozen=True, tag="pareto"):
    """Pareto of the second kind (Lomax): from zero, with a tail of rare long delays."""

    mean_ms: Milliseconds  # [ms]
    shape: Annotated[float, msgspec.Meta(gt=1.0, le=100.0)] = 3.0  # [-] smaller: longer tail

    def quantile(self, share: Floats) -> Floats:
        scale = self.mean_ms * (self.shape - 1.0)
        return scale * ((1.0 - share) ** (-1.0 / self.shape) - 1.0)


class Table(DelayDistribution, frozen=True, tag="table"):
    """Quantiles at equal shares, from the least delay to the greatest, and lines between them: two
    of them are a uniform distribution, many are measured delays."""

    ms: Annotated[tuple[Milliseconds, ...], msgspec.Meta(min_length=2, max_length=100_000)]  # [ms]

    def quantile(self, share: Floats) -> Floats:
        ordered = np.sort(np.array(self.ms))
        return np.interp(share, np.linspace(0.0, 1.0, len(ordered)), ordered)


class Trace(DelayDistribution, frozen=True, tag="trace"):
    """A recorded link, replayed in a loop: at every moment the delay or loss it had then."""

    file: str = (
        ""  # CSV `sent_s,arrived_s` beside the profile; its rows become the two fields below
    )
    sent_s: tuple[float, ...] = ()  # [s] ascending
    arrived_s: tuple[float | None, ...] = ()  # [s] None: lost

    def __post_init__(self) -> None:
        if len(self.sent_s) != len(self.arrived_s):
            raise ValueError("sent_s and arrived_s must be of the same length")
        if not self.sent_s and not self.file:
            raise ValueError("a trace needs a file")
        for before, after in zip(self.sent_s, self.sent_s[1:], strict=False):
            if not after > before:
                raise ValueError(
                    f"sent_s {after:g} comes after {before:g}, expected ascending times"
                )
        for sent, arrived in zip(self.sent_s, self.arrived_s, strict=True):
            if arrived is not None and not 0.0 <= arrived - sent <= LONGEST_MS / 1e3:
                raise ValueError(
                    f"arrived_s is {arrived:g} for sent_s {sent:g}, expected 0 to 60 s later"
                )

    def at(self, seconds: float) -> float | None:
        """[ms] Delay at a moment [s] since the link began; None: lost."""
        first, length = self.sent_s[0], self.sent_s[-1] - self.sent_s[0]
        place = first + (seconds % length if length > 0.0 else 0.0)
        k = bisect_right(self.sent_s, place) - 1
        arrived = self.arrived_s[k]
        return None if arrived is None else 1e3 * (arrived - self.sent_s[k])


Delay = Pareto | Table | Trace  # kinds of a profile file
Drawn = Exponential | Pareto | Table


class UniformStream:
    """Numbers of [0, 1), one after the other."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._left: list[float] = []

    def next(self) -> float:
        if not self._left:
            self._left = self._random.random(BLOCK).tolist()
        return self._left.pop()

    def happens(self, share: float) -> bool:
        """True with this probability. Costs no draw when it is impossible."""
        return share > 0.0 and self.next() < share


class Delays:
    """Delays drawn one after the other, each independently of the others."""

    def __init__(self, spread: Drawn, random: np.random.Generator) -> None:
        self._spread = spread
        self._random = random
        self._left: list[float] = []

    def next_ms(self) -> float:
        if not self._left:
            share = np.clip(self._random.random(BLOCK), TAIL, 1.0 - TAIL)
            drawn = self._spread.quantile(share)
            self._left = np.minimum(drawn, LONGEST_MS)[::-1].tolist()
        return self._left.pop()
