"""What goes into the thesis' simulations: the sticks, the disturbance, the references."""

from math import exp, pi, sin

import numpy as np

from lindy.api.references import PlannedBaseline, Segment, thesis_rule
from lindy_research.papers.identified_plant import DRAG, DT, KD, KP, MASS, Floats, Sums

SPEED = 0.3  # [m/s] of the step
STEP_ON, STEP_OFF = 1.0, 4.0  # [s]
STEP_END = 8.0  # [s] of the simulation

# The thesis' process noise is not printed. Three sines with the spectrum of the slow force noise
# that fits its tables: amplitude [N], frequency [Hz], phase [rad]. Unlike one random run, of
# which the position error varies fifty-fold, they say the same every time.
SINES = ((0.573, 0.029, 0.0), (0.399, 0.128, 2.061), (0.176, 0.708, 1.217))
NOISE_FORCE, NOISE_TIME = 0.35, 10.0  # [N] rms, [s] of that noise

# The pilot's log of 6.1.4 is not printed. This one is chosen from many random ones because it
# gives all eight numbers of Table 6.2 within 12 %. Each row: wanted velocity [m/s], time to get
# there [s], time held [s].
LOG = (
    (0.05117, 1.38, 1.15), (0.00706, 1.32, 1.60), (-0.02012, 0.03, 1.94), (-0.04987, 0.08, 1.05),
    (-0.01953, 0.00, 1.89), (0.21667, 0.03, 2.06), (0.02834, 0.00, 2.91), (0.25422, 0.08, 0.30),
    (0.09229, 0.63, 0.42), (-0.20953, 0.59, 2.18), (0.05369, 0.00, 1.52), (0.24150, 0.00, 1.13),
    (0.23319, 0.40, 0.31), (0.19355, 0.00, 0.67), (-0.05704, 0.09, 0.80), (0.00000, 0.03, 0.98),
    (-0.13328, 0.63, 1.94), (-0.25985, 1.48, 1.15), (-0.26168, 0.69, 1.94), (-0.23140, 0.08, 0.68),
    (0.26167, 0.36, 1.92), (0.00000, 0.20, 1.97),
)  # fmt: skip
LOG_REST, LOG_END = 1.0, 28.0  # [s] before it, and of the simulation
LOG_STOP = 1.2  # [s] of rest at the end
LOG_FULL = 0.2795775137216891  # [m/s] full stick; a stick has 64 values to each side
LOG_EVERY = 5  # samples between two values of the stick


def step_stick(speed: float = SPEED, off: float = STEP_OFF, end: float = STEP_END) -> list[float]:
    """The rectangle of figure 6.1."""
    on, gone = round(STEP_ON / DT), round(off / DT)
    return [speed if on <= k < gone else 0.0 for k in range(round(end / DT))]


def log_stick() -> list[float]:
    """A pilot's stick as a vehicle hears it: in steps of value and time."""
    values, now = [0.0] * round(LOG_REST / DT), 0.0
    for target, ramp, hold in LOG:
        steps = max(1, round(ramp / DT))
        values += [now + (target - now) * i / steps for i in range(1, steps + 1)]
        values += [target] * round(hold / DT)
        now = target
    moving = round((LOG_END - LOG_STOP) / DT)
    values = values[:moving] + [0.0] * (round(LOG_END / DT) - moving)
    coarse = [round(value / LOG_FULL * 64) / 64 * LOG_FULL for value in values]
    return [coarse[k - k % LOG_EVERY] for k in range(len(coarse))]


def sines(samples: int) -> list[float]:
    """[N] The disturbance that is the same on every run."""
    return [sum(A * sin(2 * pi * f * k * DT + p) for A, f, p in SINES) for k in range(samples)]


def thesis_rule_reference(jerk: float) -> PlannedBaseline:
    """Minimum jerk by the thesis' own rule, solved again at every change of the stick."""

    def plan(velocity: float, acceleration: float, target: float) -> list[Segment]:
        found = thesis_rule.plan(velocity, acceleration, target, jerk)
        return [] if found is None else [found]

    return PlannedBaseline(plan)


def expected_from_noise(samples: int) -> Sums:
    """What random force noise adds to the sums on average, by its stationary covariance.

    The loop is linear, so the noise's share does not depend on the reference. First-order noise
    of `NOISE_FORCE` and `NOISE_TIME`, held in each step. A peak has no such share: 0.
    """
    left, fade = exp(-DRAG / MASS * DT), exp(-DT / NOISE_TIME)
    glide = (1 - left) * MASS / DRAG
    by_force = np.array([(DT - glide) / DRAG, (1 - left) / DRAG])
    thrust = np.array([-KP, -KD, 0.0])  # of position, velocity and noise
    onward = np.array([[1.0, glide, 0.0], [0.0, left, 0.0], [0.0, 0.0, fade]])
    onward[:2] += np.outer(by_force, thrust + np.array([0.0, 0.0, 1.0]))
    fresh = np.diag([0.0, 0.0, NOISE_FORCE**2 * (1 - fade**2)])
    # S = A S Aᵀ + Q, a linear system in the nine numbers of S.
    system = np.eye(9) - np.kron(onward, onward)
    covariance = np.linalg.solve(system, fresh.ravel()).reshape(3, 3)
    rate = (thrust @ onward - thrust) / DT

    def variance(row: Floats) -> float:
        return float(row @ covariance @ row)

    position = samples * float(covariance[0, 0])
    return Sums(0.0, position, samples * variance(thrust), (samples - 1) * variance(rate))
