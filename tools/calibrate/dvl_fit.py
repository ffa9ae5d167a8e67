"""How a DVL is mounted, from its velocities beside what the IMU measures meanwhile.

In a frame F that was the body's at the beginning of a stretch of some seconds and does not turn,
the gyroscope gives the body's rotation R(t), and the specific force f the velocity

    V(t) = V₀ + ∫ R f dt + g t        of the origin, with V₀ and gravity g of each stretch unknown.

A DVL at r with the axes M (v_B = M u), whose velocities are s times the true ones, measures

    R M u = s (V + R (ω × r)) + noise                   (rigid body: Fossen 2011, eq. 7.8)

A current is in both sides, as long as it is steady over a stretch. For a given M and s all else is
linear: V₀ and g are eliminated per stretch, and what is left of all samples is one quadratic form
in the elements of M, in s, and in s times lever arm, biases of the IMU and offset of the stamps.
The noise of the DVL enters it alike for every M and s, so that it draws the fit nowhere. Each
sample is weighed by the noise of the DVL and that of a small MEMS unit, integrated.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin
from typing import NamedTuple

import numpy as np

from tools.calibrate.noise import Floats

LONGEST = 15.0  # [s] of a stretch: noise of the gyroscope adds up to more than a DVL's
DVL_GAP, IMU_GAP = 3.0, 0.1  # [s] a longer one ends a stretch
SPARE = 0.3  # [s] of the IMU at both ends: a DVL's stamps may be off
FEWEST = 6  # samples of the DVL in a stretch
FORCE_NOISE, RATE_NOISE = 2e-3, 1.5e-4  # [m/s²/√Hz], [rad/s/√Hz] of a small MEMS unit
GRAVITY = 9.81  # [m/s²]
LEAST_STD = 0.001  # [m/s] no DVL is better
SMOOTH = 9  # IMU samples of the acceleration that tells the stamps' offset
# One standard deviation before anything is measured: tilt and yaw [rad], scale [-], lever arm [m],
# biases of the IMU [m/s²] and [rad/s], offset of the stamps [s].
PRIOR = np.array([0.2, 0.2, 2.0, 0.05, *[1.0] * 3, *[0.2] * 3, *[0.2] * 3, 0.1])
ROUNDS, STEPS = 25, 30  # of what is taken away, and of the fit within each
SETTLED = 1e-6  # [rad, -, m …] a smaller step ends it
STARTS = 12  # headings from which the fit begins
MISFIT, WORSE = 25.0, 10.0  # [-] squared error over variance of a stretch that is left out
TAKEN, OWN = slice(10, 14), slice(7, 11)  # of these numbers, and of `Unknowns.rest`
TURNS = np.array(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
)  # small rotations about forward, starboard and down


class DvlStretch(NamedTuple):
    """Samples of some seconds without a gap."""

    imu: Floats  # shape (m, 7): [s], angular rate [rad/s], specific force [m/s²]; body, at origin
    dvl: Floats  # shape (n, 5): [s], velocity [m/s] as it measures it, std [m/s]


class DvlFit(NamedTuple):
    """What the stretches say."""

    rotation: Floats  # shape (3, 3), R_BS
    scale: float  # [-] of its velocities over the true ones
    arm: Floats  # [m] shape (3,), body
    stamps: float  # [s] by which it measures later than it says
    std: Floats  # shape (14,): rotation about the body's axes [rad], then in the order above
    used: int  # stretches
    left_out: int  # that do not fit

    @property
    def yaw(self) -> float:
        """[rad] Of its X axis, clockwise from the vehicle's bow."""
        return atan2(self.rotation[1, 0], self.rotation[0, 0])

    @property
    def lean(self) -> tuple[float, float]:
        """[rad] By which its Z axis leans forward and to starboard from the vehicle's down."""
        ahead, aside, down = self.rotation[:, 2].tolist()
        return atan2(ahead, down), atan2(aside, down)


class Unknowns(NamedTuple):
    """The point about which the fit is linear."""

    rotation: Floats
    rest: Floats  # shape (11,): scale, lever arm, biases, offset of the stamps
    # shape (4,): of the gyroscope's bias and of the stamps' offset, taken away already
    taken: Floats

    @property
    def point(self) -> Floats:
        """Shape (20,): the arguments of the quadratic form."""
        scale = self.rest[0]
        return np.concatenate([self.rotation.ravel(), [-scale], -scale * self.rest[1:]])

    @property
    def slope(self) -> Floats:
        """Shape (20, 14): that of `point` over a small rotation and the rest."""
        J, scale = np.zeros((20, 14)), self.rest[0]
        J[:9, :3] = np.array([(turn @ self.rotation).ravel() for turn in TURNS]).T
        J[9, 3] = -1.0
        J[10:, 3] = -self.rest[1:]
        J[10:, 4:] = -scale * np.eye(10)
        return J

    @property
    def unlikely(self) -> Floats:
        """Shape (14,): how far it is from what is likely, in the units of the steps."""
        ahead, aside = self.rotation[0, 2], self.rotation[1, 2]
        far = np.concatenate([[-aside, ahead, 0.0, self.rest[0] - 1.0], self.rest[1:]])
        far[TAKEN] += self.taken
        return far

    @property
    def more(self) -> Floats:
        """Shape (4,): what is to be taken away beside that."""
        return self.rest[OWN]

    def settled(self, taken: Floats) -> "Unknowns":
        """The same where all of them, shape (4,), are taken away."""
        rest = self.rest.copy()
        rest[OWN] = 0.0
        return Unknowns(self.rotation, rest, taken)

    def moved(self, step: Floats) -> "Unknowns":
        return Unknowns(_turn(step[:3]) @ self.rotation, self.rest + step[3:], self.taken)


def stretches(imu: Floats, dvl: Floats) -> list[DvlStretch]:
    """Cut at gaps, and where they would be too long.

    Args:
        imu, dvl: as of `DvlStretch`, in order.
    """
    found = list[DvlStretch]()
    if len(imu) < 2:
        return found
    run = np.concatenate([[0], np.cumsum(np.diff(imu[:, 0]) > IMU_GAP)])
    after = np.searchsorted(imu[:, 0], dvl[:, 0], side="right")
    inside = (after > 0) & (after < len(imu))
    inside[inside] = run[after[inside] - 1] == run[after[inside]]
    dvl, after = dvl[inside], after[inside]
    begin = 0
    for i in range(1, len(dvl) + 1):
        if (
            i < len(dvl)
            and dvl[i, 0] - dvl[i - 1, 0] <= DVL_GAP
            and dvl[i, 0] - dvl[begin, 0] <= LONGEST
            and run[after[i] - 1] == run[after[begin] - 1]
        ):
            continue
        if i - begin >= FEWEST:
            first, last = np.searchsorted(imu[:, 0], [dvl[begin, 0] - SPARE, dvl[i - 1, 0] + SPARE])
            same = run[first:last] == run[after[begin]]
            found.append(DvlStretch(imu[first:last][same], dvl[begin:i]))
        begin = i
    return found


def fitted(those: Sequence[DvlStretch]) -> DvlFit | None:
    """None: there are none.

    The gyroscope's bias and the stamps' offset enter through their first derivatives, so all is
    done again with what was found of them, until nothing more is.
    """
    if not those:
        return None
    rates = np.concatenate([stretch.imu[:, 1:4] for stretch in those])
    taken: Floats = np.append(np.median(rates, axis=0), 0.0)  # most of the time it does not turn
    forms = [_form(stretch, taken, None) for stretch in those]
    found, kept = _robust(forms, taken, None)
    for _ in range(ROUNDS):
        if np.abs(found.more).max() < SETTLED:
            break
        taken = taken + found.more
        forms = [_form(stretch, taken, found) for stretch in those]
        found, kept = _robust(forms, taken, found)
    return _judged(found, forms, kept)


class QuadraticForm(NamedTuple):
    """Of one stretch: squared error over variance is pᵀ Q p."""

    Q: Floats  # shape (20, 20)
    freedom: int  # [-] numbers it consists of, less those that are its own
    noise: float  # [-] what the DVL's noise adds to the first nine elements of Q's diagonal

    def misfit(self, point: Floats) -> float:
        return float(point @ self.Q @ point) / self.freedom


def _robust(
    forms: Sequence[QuadraticForm], taken: Floats, before: Unknowns | None
) -> tuple[Unknowns, list[QuadraticForm]]:
    """A first fit of all, a second one without those that do not fit it."""
    found, kept = _least(forms, taken, before), list(forms)
    for _ in range(3):
        errors = [form.misfit(found.point) for form in forms]
        most = max(MISFIT, WORSE * float(np.median(errors)))
        fits = [form for form, error in zip(forms, errors, strict=True) if error <= most]
        if len(fits) == len(kept):
            break
        kept = fits
        found = _least(kept, taken, before)
    return found, kept


def _judged(
    found: Unknowns, forms: Sequence[QuadraticForm], kept: Sequence[QuadraticForm]
) -> DvlFit:
    """With standard deviations: the larger ones of what the noise explains, scaled by the error
    that is left, and of what the stretches differ by (White 1980, Econometrica 48(4))."""
    point, J = found.point, found.slope
    freedom = max(1, int(np.sum([form.freedom for form in kept])))
    misfit = float(np.sum([point @ form.Q @ point for form in kept])) / freedom
    # Velocities that are noise alone tell nothing of how they are turned.
    Q: Floats = np.sum([form.Q for form in kept], axis=0)
    Q[:9, :9] -= max(1.0, misfit) * np.sum([form.noise for form in kept]) * np.eye(9)
    values, axes = np.linalg.eigh(np.outer(PRIOR, PRIOR) * _normal(found, Q)[0])
    P = np.outer(PRIOR, PRIOR) * ((axes / np.maximum(values, 1.0)) @ axes.T)
    scores = np.array([J.T @ form.Q @ point for form in kept])
    own = np.diag(P) * max(1.0, misfit)
    differ = np.diag(P @ (scores.T @ scores) @ P) * len(kept) / max(1, len(kept) - 1)
    scale, *others = found.rest.tolist()
    stamps = found.taken[3] + others[-1]
    return DvlFit(
        found.rotation, scale, np.array(others[:3]), stamps,
        np.sqrt(np.maximum(own, differ)), len(kept), len(forms) - len(kept),
    )  # fmt: skip


def _least(forms: Sequence[QuadraticForm], taken: Floats, before: Unknowns | None) -> Unknowns:
    """From where it was found to be before, at first from several headings; the best."""
    Q: Floats = np.sum([form.Q for form in forms], axis=0)
    if before is not None:
        return _descended(before.settled(taken), Q)
    rest = np.concatenate([[1.0], np.zeros(10)])
    starts = [Unknowns(_about_down(2.0 * pi * i / STARTS), rest, taken) for i in range(STARTS)]
    return min((_descended(start, Q) for start in starts), key=lambda end: _cost(end, Q))


def _descended(at: Unknowns, Q: Floats) -> Unknowns:
    """By Gauss and Newton, with steps that lead down."""
    cost = _cost(at, Q)
    for _ in range(STEPS):
        H, g = _normal(at, Q)
        step: Floats = -np.linalg.solve(H, g).astype(np.float64)
        step *= min(1.0, 0.5 / max(1e-12, hypot(*step[:3].tolist())))
        after = at.moved(step)
        while (new := _cost(after, Q)) > cost and np.abs(step).max() > SETTLED:
            step = 0.5 * step
            after = at.moved(step)
        at, cost = after, new
        if np.abs(step).max() < SETTLED:
            break
    return at


def _cost(at: Unknowns, Q: Floats) -> float:
    p, prior = at.point, at.unlikely / PRIOR
    return float(p @ Q @ p + prior @ prior)


def _normal(at: Unknowns, Q: Floats) -> tuple[Floats, Floats]:
    """Half the second and half the first derivative of `_cost`."""
    J = at.slope
    H = J.T @ Q @ J + np.diag(PRIOR**-2.0)
    return H, J.T @ Q @ at.point + at.unlikely * PRIOR**-2.0


def _form(stretch: DvlStretch, taken: Floats, before: Unknowns | None) -> QuadraticForm:
    """
    Args:
        taken: as of `Unknowns`.
        before: what was found with less of them; None: what the velocities turn by is left out.
    """
    t, rate, force = stretch.imu[:, 0], stretch.imu[:, 1:4] - taken[:3], stretch.imu[:, 4:]
    at, u = stretch.dvl[:, 0] + taken[3], stretch.dvl[:, 1:4]
    dt = np.diff(t)
    R = _rotations(0.5 * (rate[1:] + rate[:-1]) * dt[:, None])
    felt = np.einsum("nij,nj->ni", R, force)
    of_force = -_integral(R, dt)  # by the accelerometer's bias …
    turned = np.asarray(np.cross(of_force, felt[:, :, None], axis=1), dtype=np.float64)
    of_rate = _integral(turned, dt)  # by the gyroscope's

    there = _Between(t, at)
    R_at, omega = there.of(R), there.of(_smooth(rate))
    lever = np.einsum("nij,njk->nik", R_at, np.einsum("nk,kij->nij", omega, TURNS))  # R [ω]×
    later = there.of(_smooth(felt - felt.mean(axis=0)))
    of_force, of_rate = there.of(of_force), there.of(of_rate)
    U = np.einsum("nij,nk->nijk", R_at, u).reshape(len(at), 3, 9)
    gained = there.of(_integral(felt, dt))[:, :, None]
    Z = np.concatenate([U, gained, lever, of_force, of_rate, later[:, :, None]], axis=2)
    time = np.stack([np.ones_like(at), at - at.mean()], axis=1)
    W = _weights(at - at[0], np.maximum(stretch.dvl[:, 4], LEAST_STD))
    inner = time.T @ W @ time
    if before is not None:
        # What is compared turns, too. As it is expected: the noise of the DVL would weaken it.
        error = Z @ before.settled(taken).point
        error = error - time @ np.linalg.solve(inner, time.T @ W @ error)
        over_ground = U @ before.rotation.ravel() - error
        Z[:, :, 19] -= np.cross(np.einsum("nij,nj->ni", R_at, omega), over_ground)
        Z[:, :, 16:19] -= np.cross(of_force, over_ground[:, :, None], axis=1)
    Wt = W @ time
    own = W - Wt @ np.linalg.solve(inner, Wt.T)
    flat = Z.reshape(len(at), -1)
    Q: Floats = np.einsum("nai,naj->ij", Z, (own @ flat).reshape(Z.shape), optimize=True)
    noise = float(np.diag(own) @ np.maximum(stretch.dvl[:, 4], LEAST_STD) ** 2)
    return QuadraticForm(Q, 3 * len(at) - 6, noise)


def _weights(t: Floats, std: Floats) -> Floats:
    """Shape (n, n): inverse covariance of a component at the times `t` [s]."""
    first, last = np.minimum.outer(t, t), np.maximum.outer(t, t)
    tilting = (GRAVITY * RATE_NOISE) ** 2 * first**2 * (3.0 * last - first) / 6.0
    return np.linalg.inv(np.diag(std**2) + FORCE_NOISE**2 * first + tilting).astype(np.float64)


class _Between:
    """Values at times between those of the IMU, by straight lines."""

    def __init__(self, t: Floats, at: Floats) -> None:
        after = np.clip(np.searchsorted(t, at, side="right"), 1, len(t) - 1)
        self._after, self._share = after, (at - t[after - 1]) / (t[after] - t[after - 1])

    def of(self, values: Floats) -> Floats:
        share = self._share.reshape(-1, *[1] * (values.ndim - 1))
        return (1.0 - share) * values[self._after - 1] + share * values[self._after]


def _integral(values: Floats, dt: Floats) -> Floats:
    """By trapezoids, from 0."""
    middle = 0.5 * (values[1:] + values[:-1]) * dt.reshape(-1, *[1] * (values.ndim - 1))
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(middle, axis=0)])


def _smooth(values: Floats) -> Floats:
    """Means of some samples around each, shape (m, 3)."""
    kernel = np.ones(SMOOTH)
    count = np.convolve(np.ones(len(values)), kernel, "same")
    return np.stack([np.convolve(v, kernel, "same") / count for v in values.T], axis=1)


def _rotations(steps: Floats) -> Floats:
    """Shape (m + 1, 3, 3), from the first body to the frame of the beginning, by small turns [rad],
    shape (m, 3), each in the body's axes."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    kept = [(w, x, y, z)]
    angle = np.linalg.norm(steps, axis=1)
    half = 0.5 * np.sinc(angle / (2.0 * pi))  # sin(angle / 2) / angle
    for c, (i, j, k) in zip(np.cos(angle / 2.0).tolist(), (half[:, None] * steps).tolist(),
                            strict=True):  # fmt: skip
        w, x, y, z = (
            w * c - x * i - y * j - z * k,
            w * i + x * c + y * k - z * j,
            w * j - x * k + y * c + z * i,
            w * k + x * j - y * i + z * c,
        )
        kept.append((w, x, y, z))
    q = np.array(kept)
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _turn(angle: Floats) -> Floats:
    """The rotation by an angle [rad], shape (3,)."""
    return _rotations(angle[None, :])[1]


def _about_down(yaw: float) -> Floats:
    return np.array([[cos(yaw), -sin(yaw), 0.0], [sin(yaw), cos(yaw), 0.0], [0.0, 0.0, 1.0]])
