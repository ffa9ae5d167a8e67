"""How well roll and pitch are known, and so what the accelerometer is worth to them now.

The gyroscope's tilt drifts by its noise and by its bias; the accelerometer shows down with the
vehicle's acceleration in it. How the one is weighed against the other is a Kalman filter of two
states, the tilt error and the error of the bias (Mahony et al. 2008, eq. 48, is its form with
constant gains). Nothing distinguishes roll from pitch, so one covariance serves both.
"""

from math import sqrt

# [rad²/s] noise of a gyroscope under way, its scale error in turns included.
TILT_NOISE = 0.0003**2
BIAS_WALK = 3e-6**2  # [rad²/s³] of the bias: 10 deg/h in five minutes
LEARNING_WALK = 3e-5  # [rad²/s³] the same while it is learnt anew: in two seconds
# [-] of a turn that is missed or leaks into another axis: scale, misalignment, motion between two
# samples.
MISSED = 0.01
MEMORY = 1.0  # [s] an acceleration lasts about as long: no new measurement comes sooner
UNKNOWN_BIAS = 0.3  # [rad/s] 1σ of a bias that has changed
MOST = 1.0  # [rad] 1σ; more is not known at all


class TiltSpread:
    """Covariance of the errors of tilt and bias."""

    __slots__ = ("bias", "both", "tilt")

    def __init__(self, tilt_std: float, bias_std: float) -> None:
        """1σ [rad] and [rad/s]."""
        self.tilt = tilt_std * tilt_std  # [rad²]
        self.both = 0.0  # [rad²/s]
        self.bias = bias_std * bias_std  # [rad²/s²]

    @property
    def std(self) -> float:
        """[rad] of the tilt."""
        return sqrt(self.tilt)

    def predict(
        self, dt: float, turning: float, noise: float, unseen: float, learning: bool
    ) -> None:
        """Advance by `dt` [s] at a rate `turning` [rad/s], measured with a
        variance `noise` [rad²/s²] of one sample; `unseen` [rad²]: of a turn between two.
        `learning`: the bias has changed, and may again."""
        missed = MISSED * turning
        grown = self.tilt + dt * (dt * self.bias - 2.0 * self.both)
        self.tilt = min(MOST, grown + unseen + (TILT_NOISE + missed * missed + noise * dt) * dt)
        self.both -= dt * self.bias
        self.bias += (LEARNING_WALK if learning else BIAS_WALK) * dt

    def correct(self, variance: float) -> tuple[float, float]:
        """The tilt is measured with this variance [rad²]. Returns the shares [-, 1/s] of the
        deviation by which tilt and bias are corrected."""
        total = self.tilt + variance
        share, of_bias = self.tilt / total, self.both / total
        self.bias -= of_bias * self.both
        self.both -= share * self.both
        self.tilt -= share * self.tilt
        return share, of_bias

    def doubt(self, tilt_std: float, bias_std: float = 0.0) -> None:
        """Tilt and bias may be wrong by this much more: [rad], [rad/s]."""
        self.tilt = min(MOST, self.tilt + tilt_std * tilt_std)
        self.bias += bias_std * bias_std

    def rest(self, bias_std: float) -> None:
        """The bias has been measured at rest [rad/s]."""
        self.both, self.bias = 0.0, bias_std * bias_std
