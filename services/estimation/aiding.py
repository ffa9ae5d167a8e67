"""What an observer makes of one measured quantity: does its innovation fit the stated spread?

The innovations of a filter that knows its errors are white: over their standard deviation they have
zero mean and unit variance (Bar-Shalom, Li and Kirubarajan 2001, *Estimation with Applications to
Tracking and Navigation*, §5.4). A running mean and a running variance show where they are not.
"""

from math import sqrt

from messages.aiding import AidSource
from messages.events import Event

MEMORY = 1.0  # [s] of the running mean and variance …
# … but at least so many samples: over one second of a sensor with 8 Hz, noise alone has a mean that
# spreads by 0.26 σ; over 20 samples it has 0.16.
SAMPLES = 20
AID_SOURCES = (
    *("pressure", "trial", "accelerometer", "gyroscope_roll", "gyroscope_pitch", "compass"),
    *("dvl_surge", "dvl_sway", "usbl_north", "usbl_east"),
    *("thrust_surge", "thrust_sway", "thrust_north", "thrust_east"),
)
MOST_RATIO = 1e6  # [-] a larger test ratio counts as that


class Aiding:
    """One quantity. The running mean and variance go on for ever; the sums for the message are of
    the samples since the one before."""

    __slots__ = (
        "_compared", "_largest", "_reasons", "_rejected", "_samples", "_squares", "_stamp_ns",
        "_sum", "_used_ns", "_value", "_variances", "_weights", "mean", "name", "share", "unit",
        "variance_ratio", "verdict", "whole_until",
    )  # fmt: skip

    def __init__(self, name: str, unit: str, whole_until: float = 1.0) -> None:
        """`whole_until`: test ratio from which a sample has less weight."""
        self.name, self.unit, self.whole_until = name, unit, whole_until
        self.verdict: str | None = None  # event: why the sensor is not trusted now
        self._stamp_ns = 0
        self._empty()
        self.forget()

    def forget(self) -> None:
        """The innovations before say nothing about those to come."""
        self.mean = 0.0  # [σ] of the innovations as they are used, so clipped
        self.variance_ratio = 1.0  # [-] of the innovations as they are
        self.share = 1.0 / SAMPLES  # [-] of the newest of them in the means
        self._used_ns: int | None = None

    @property
    def mean_std(self) -> float:
        """[-] 1σ of the running mean, of white innovations."""
        return sqrt(self.share / (2.0 - self.share))

    def compare(
        self,
        stamp_ns: int,
        value: float,
        innovation: float,
        variance: float,
        test_ratio: float,
        used: float | None = None,
        *,
        fresh: bool = True,
        rejected: Event | None = None,
    ) -> None:
        """A sample that was compared with what was expected of it.

        Args:
            stamp_ns: [ns] its time of validity.
            value, innovation, variance: in the unit, and its square.
            test_ratio: [-] squared innovation over the largest allowed.
            used: what is left of the innovation if it is clipped; None: all.
            fresh: it says something new; a repeated value may be of a frozen sensor.
            rejected: why it is not used; None: it is.
        """
        self._samples += 1
        self._compared += 1
        self._stamp_ns, self._value = stamp_ns, value
        self._sum += innovation
        self._squares += innovation * innovation
        self._variances += variance
        if test_ratio > self._largest:
            self._largest = min(MOST_RATIO, test_ratio)
        if rejected is not None:
            self._rejected += 1
            self._reasons[rejected.name] = None
            return
        used = innovation if used is None else used
        self._weights += used / innovation if innovation else 1.0
        if not fresh:
            return
        before, self._used_ns = self._used_ns, stamp_ns
        if before is None:
            return
        # A gap between samples gives the next one no more weight.
        share = min(1.0 / SAMPLES, max(0.0, (stamp_ns - before) * 1e-9 / MEMORY))
        self.share = share
        self.mean += share * (used / sqrt(variance) - self.mean)
        square = innovation * innovation / variance
        self.variance_ratio += share * (square - self.variance_ratio)

    def refuse(self, why: Event, stamp_ns: int) -> None:
        """A sample that was not even compared."""
        self._samples += 1
        self._stamp_ns = stamp_ns
        self._rejected += 1
        self._reasons[why.name] = None

    def message(self, trouble: str | None = None) -> AidSource | None:
        """All samples since the last call; None: there are none. `trouble`: event, why
        the sensor is not trusted, by others."""
        n, compared = self._samples, self._compared
        if n == 0:
            return None
        mean = self._sum / compared if compared else 0.0
        source = AidSource(
            stamp_ns=self._stamp_ns,
            unit=self.unit,
            samples=n,
            value=self._value if compared else None,
            innovation=mean if compared else None,
            spread=sqrt(max(0.0, self._squares / compared - mean * mean)) if compared else None,
            variance=self._variances / compared if compared else None,
            test_ratio=self._largest if compared else None,
            whole_until=self.whole_until,
            weight=self._weights / compared if compared else 0.0,
            rejected=self._rejected / n,
            reasons=tuple(self._reasons),
            mean=self.mean,
            variance_ratio=self.variance_ratio,
            verdict=self.verdict or trouble,
        )
        self._empty()
        return source

    def _empty(self) -> None:
        self._samples = self._compared = 0
        self._value = self._sum = self._squares = self._variances = 0.0
        self._largest = self._weights = 0.0
        self._rejected = 0
        self._reasons: dict[str, None] = {}  # each once, in their order
