"""The gyroscope at rest: bias and noise."""

from math import sqrt

from messages.message import Message
from messages.sensors import ImuSample
from tools.calibrate.rests import RestMean, RestWatch
from tools.calibrate.results import CalibrationError, SensorFound, Setting

ENOUGH = 30.0  # [s]
LEAST = 10.0  # [s] of a recording


class GyroscopeGuide:
    """Waits for a rest. The longest one counts."""

    def __init__(self) -> None:
        self._watch = RestWatch()
        self._best: RestMean | None = None

    def see(self, sample: Message) -> None:
        if isinstance(sample, ImuSample):
            longer = self._watch.imu(sample.angular_rate, sample.specific_force, sample.stamp_ns)
            if longer and (self._best is None or self._watch.seconds > self._best.seconds):
                self._best = self._watch.result() or self._best

    @property
    def done(self) -> bool:
        return self._best is not None and self._best.seconds >= ENOUGH

    @property
    def prompt(self) -> str:
        moved = f" ({self._watch.moved})" if self._watch.moved else ""
        so_far = f"{self._watch.seconds:.0f} of {ENOUGH:.0f} s"
        return f"lay the vehicle down and leave it alone{moved}: {so_far}"

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: it was never at rest for long enough.
        """
        best = self._best
        if best is None or best.seconds < LEAST:
            seconds = 0.0 if best is None else best.seconds
            why = f", because {self._watch.moved}" if self._watch.moved else ""
            raise CalibrationError(
                f"gyroscope: the longest rest is {seconds:.1f} s, needed are {LEAST:.0f}{why}; "
                f"lay the vehicle on something firm"
            )
        p, q, r = best.mean[:3].tolist()
        a, b, c = best.mean_std[:3].tolist()
        density = max(best.std[:3].tolist()) * sqrt(best.seconds / best.samples)
        about = f"rest of {best.seconds:.0f} s"
        return SensorFound(
            (Setting("gyro_bias", (p, q, r), (a, b, c), "rad/s", about),),
            (
                f"gyroscope: noise {density:.2g} rad/s/√Hz on the worst axis; its bias is learnt "
                f"anew before each dive, so this matters only where it exceeds "
                f"estimation.calibration.largest_bias",
            ),
        )
