"""What the estimator makes of its measurements, one message per measured quantity. From
`estimation`, for people and files.

Of one sample: the innovation is what was measured minus what was predicted; its variance is what
the observer expects of it; the test ratio is its square over that of the largest one allowed, so
that a sample beyond 1 is rejected (PX4's EstimatorAidSource has the same).
"""

from messages.message import Message
from messages.units import Count, Finite, Name, Names, NotNegative, Share


class AidSource(Message, frozen=True, kw_only=True):
    """All samples since the message before: one, or those of a tenth of a second. `stamp_ns` is the
    time of the newest."""

    unit: Name  # of value and innovation; its square, of the variance
    samples: Count
    value: Finite | None = None  # [unit] newest; None: no sample was compared
    innovation: Finite | None = None  # [unit] mean
    spread: NotNegative | None = None  # [unit] standard deviation of the innovations
    variance: NotNegative | None = None  # [unit²] of one innovation, as expected; mean
    test_ratio: NotNegative | None = None  # [-] largest; beyond 1 rejected
    whole_until: NotNegative = 1.0  # [-] test ratio from which a sample has less weight
    weight: Share = 0.0  # [-] mean over the compared samples; 0 rejected, 1 whole
    rejected: Share = 0.0  # [-] of all samples
    reasons: Names = ()  # events that say why samples were rejected
    # [-] Running means, over a second or 20 samples, of the innovation over its standard deviation
    # and of that squared: 0 and 1 if the spread is as stated.
    mean: Finite = 0.0
    variance_ratio: NotNegative = 1.0
    verdict: Name | None = None  # event that says why the sensor is not trusted now; None: it is
