"""What the filter makes of one measured number: the same questions for every sensor.

    how noisy?     the white part by the differences of successive innovations, the coloured part by
                   what is left of their squares (Mehra 1970, covariance matching), as R + 2 τ σ²/Δt
    an outlier?    beyond `GATE`; inside, Huber's clip (1964): a disturbance just inside the gate
                   does not change the state so much that good samples look like outliers after it
    persistently?  most samples of its `patience` are outliers: the caller sets the states that it
                   measures anew
    off centre?    the mean innovation is beyond `UNBIASED` of its own 1σ: something else is wrong
                   than its noise

The innovations of a filter that knows its errors are white: over their standard deviation they have
zero mean and unit variance (Bar-Shalom, Li and Kirubarajan 2001, *Estimation with Applications to
Tracking and Navigation*, §5.4). `message` shows people where they are not.
"""

from enum import Enum
from math import sqrt

from messages.events import Event
from messages.state import AidSource
from services.estimation.filter import ErrorStateFilter, Floats, Row

GATE, CLIP = 4.5, 2.0  # [σ] tuned on simulated and real dives, range 4 … 6 and 1.5 … 3
MOST_OUT = 0.6  # [-] share of outliers within `patience` that are no longer outliers
UNBIASED = 6.0  # [σ]
WHITE_SAMPLES = 60  # of the mean of squared differences
QUIETER, NOISIER = 0.2, 20.0  # [-] times the stated noise, that is taken from innovations
LONGEST = 5.0  # [s] between two samples
MATCHED_S = 10.0  # [s] of the coloured noise
MOST_RATIO = 1e6  # [-] a larger test ratio counts as that


class Fusion(Enum):
    USED = 0
    OUTLIER = 1
    PERSISTENT = 2  # an outlier, as most have been for long


class Quantity:
    """One number."""

    def __init__(
        self,
        name: str,
        unit: str,
        white: float,
        coloured: float = 0.0,
        time: float = 0.0,
        patience: float = 2.0,
        memory: float = 2.0,
        most_factor: float = 9.0,
    ) -> None:
        """
        Args:
            name, unit: of the messages.
            white: [unit] stated 1σ of one sample.
            coloured, time: [unit] stated 1σ of what lasts, [s] and for how long.
            patience: [s] of outliers only.
            memory: [s] of the mean innovation.
            most_factor: [-] times the stated variance that is coloured, at most.
        """
        self.name, self.unit = name, unit
        self.white, self.coloured, self.time = white, coloured, time
        self.patience, self.memory, self.most_factor = patience, memory, most_factor
        self.rounding = 0.0  # [unit²] of a coarse sensor
        self.white_variance = white * white  # [unit²] as measured
        self.used_ns: int | None = None  # [ns] newest sample used
        self.period = 1.0  # [s] from the sample before to the newest
        self._stamp_ns: int | None = None  # [ns] newest sample compared
        self._last: float | None = None
        self.forget()
        self._empty()

    def forget(self) -> None:
        """The innovations before say nothing about those to come."""
        self.mean = 0.0  # [σ] running, of the innovations
        self.newest = 0.0  # [σ] of the newest used
        self.variance_ratio = 1.0  # [-] running, of their squares over their variance
        self.out = 0.0  # [-] share of outliers lately
        self._share = 0.0  # [-] of the newest in the mean
        self.factor = 1.0  # [-] of the coloured variance, as matched
        self._last = None

    def restart(self) -> None:
        """After a number that is not finite."""
        self.white_variance = self.white * self.white
        self.forget()

    @property
    def off_centre(self) -> bool:
        return abs(self.mean) > UNBIASED * sqrt(self._share / (2.0 - self._share))

    def fuse(
        self,
        f: ErrorStateFilter,
        h: Row,
        value: float,
        innovation: float,
        stamp_ns: int,
        mask: Floats | None = None,
        why: Event | None = None,
    ) -> Fusion:
        """Correct the filter by a sample at its time of validity [ns], unless it is an outlier.

        Args:
            h: of the measurement; `mask`: see `ErrorStateFilter.correct`.
            value, innovation: [unit] measured, and measured minus predicted.
            why: the event that an outlier is counted as in the messages.
        """
        before, self._stamp_ns = self._stamp_ns, stamp_ns
        dt = 1.0 if before is None else min(LONGEST, max(1e-3, (stamp_ns - before) * 1e-9))
        self.period = dt
        Ph, explained = f.explained(h)
        S = explained + self._variance(dt)
        slow = self.factor * self.coloured * self.coloured
        # What is coloured adds little information, but does not scatter more for that.
        single = explained + self.rounding + self.white_variance + slow
        std, share = sqrt(single), min(0.2, dt / self.patience)
        size = abs(innovation)
        self._note(stamp_ns, value, innovation, S)
        if size > GATE * std:
            self._rejected += 1
            if why is not None:
                self._reasons[why.name] = None
            self.out += share * (1.0 - self.out)
            return Fusion.PERSISTENT if self.out > MOST_OUT else Fusion.OUTLIER
        self.out -= share * self.out
        self.newest = innovation / sqrt(S)
        self._centre(self.newest, dt)
        self._match(innovation, explained, dt)
        used = max(-CLIP * std, min(CLIP * std, innovation))
        self._weights += used / innovation if innovation else 1.0
        f.correct(Ph, S, used, mask)
        self.used_ns = stamp_ns
        return Fusion.USED

    def set_anew(
        self,
        f: ErrorStateFilter,
        h: Row,
        innovation: float,
        stamp_ns: int,
        mask: Floats | None = None,
    ) -> None:
        """Use a sample whatever its size, once the caller has widened the states it measures."""
        Ph, explained = f.explained(h)
        f.correct(Ph, explained + self._variance(1.0), innovation, mask)
        self.forget()
        self.used_ns = stamp_ns

    def _variance(self, dt: float) -> float:
        """[unit²] Of one sample, `dt` [s] after the one before: coloured noise as white noise of
        the same spectral density."""
        slow = self.factor * self.coloured * self.coloured
        return self.rounding + self.white_variance + slow * max(1.0, 2.0 * self.time / dt)

    def _match(self, innovation: float, explained: float, dt: float) -> None:
        stated = self.white * self.white
        if self._last is not None:
            step = innovation - self._last
            seen = min(0.5 * step * step, 9.0 * self.white_variance)
            measured = self.white_variance + (seen - self.white_variance) / WHITE_SAMPLES
            self.white_variance = min(max(measured, QUIETER**2 * stated), NOISIER**2 * stated)
        self._last = innovation
        if self.coloured > 0.0:
            # A mean is no noise.
            off = innovation - self.mean * sqrt(explained + self._variance(dt))
            seen = (off * off - explained) / (self.coloured * self.coloured)
            seen = max(0.0, min(2.0 * self.most_factor, seen))
            self.factor += min(0.1, dt / MATCHED_S) * (seen - self.factor)
            self.factor = max(1.0, min(self.most_factor, self.factor))

    def _centre(self, normalised: float, dt: float) -> None:
        share = self._share = min(0.2, dt / self.memory)
        self.mean += share * (max(-3.0, min(3.0, normalised)) - self.mean)
        self.variance_ratio += share * (normalised * normalised - self.variance_ratio)

    # For people.

    def refuse(self, why: Event, stamp_ns: int) -> None:
        """A sample that was not even compared."""
        self._samples += 1
        self._rejected += 1
        self._newest_ns = stamp_ns
        self._reasons[why.name] = None

    def _note(self, stamp_ns: int, value: float, innovation: float, S: float) -> None:
        self._samples += 1
        self._compared += 1
        self._newest_ns, self._value = stamp_ns, value
        self._sum += innovation
        self._squares += innovation * innovation
        self._variances += S
        self._largest = max(self._largest, min(MOST_RATIO, innovation * innovation / (GATE**2 * S)))

    def message(self, trouble: str | None = None) -> AidSource | None:
        """All samples since the last call; None: there are none. `trouble`: event, why the sensor
        is not used now."""
        n, compared = self._samples, self._compared
        if n == 0:
            return None
        mean = self._sum / compared if compared else 0.0
        source = AidSource(
            stamp_ns=self._newest_ns,
            unit=self.unit,
            samples=n,
            value=self._value if compared else None,
            innovation=mean if compared else None,
            spread=sqrt(max(0.0, self._squares / compared - mean * mean)) if compared else None,
            variance=self._variances / compared if compared else None,
            test_ratio=self._largest if compared else None,
            whole_until=(CLIP / GATE) ** 2,
            weight=self._weights / compared if compared else 0.0,
            rejected=self._rejected / n,
            reasons=tuple(self._reasons),
            mean=self.mean,
            variance_ratio=self.variance_ratio,
            verdict=trouble,
        )
        self._empty()
        return source

    def _empty(self) -> None:
        self._samples = self._compared = self._rejected = self._newest_ns = 0
        self._value = self._sum = self._squares = self._variances = 0.0
        self._largest = self._weights = 0.0
        self._reasons: dict[str, None] = {}  # each once, in their order
