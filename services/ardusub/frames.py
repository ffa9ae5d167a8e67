"""ArduSub's frames: what each motor gets of each axis, and which motors share a limit.

The factors are those of ArduSub 4.5 and 4.8, reproduced from SERVO_OUTPUT_RAW of both for
FRAME_CONFIG 0 to 7.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign

from services.marine.summation import plain_sum
from services.marine.vehicle import Thruster, wrench_per_newton

Factors = tuple[float, float, float, float, float, float]
ROLL, PITCH, YAW, THROTTLE, FORWARD, LATERAL = range(6)  # columns of the factors
# Row of a wrench (X, Y, Z, K, M, N) for each column, and its sign: throttle is upwards.
ROW = {ROLL: 3, PITCH: 4, YAW: 5, THROTTLE: 2, FORWARD: 0, LATERAL: 1}
SIGN = {ROLL: 1.0, PITCH: 1.0, YAW: 1.0, THROTTLE: -1.0, FORWARD: 1.0, LATERAL: 1.0}
TILTED: tuple[frozenset[int], frozenset[int]] = (
    frozenset({ROLL, PITCH, THROTTLE}),
    frozenset({YAW, FORWARD, LATERAL}),
)


@dataclass(frozen=True, slots=True)
class MotorFrame:
    name: str
    motors: tuple[Factors, ...]  # roll, pitch, yaw, throttle, forward, lateral; up is positive
    normalised: bool = False  # each group of axes in TILTED is scaled to its largest motor
    coupled: bool = False  # MOT_FV_CPLNG_K limits the forward share of the rear pair


_HORIZONTAL: tuple[Factors, ...] = (
    (0, 0, 1, 0, -1, 1), (0, 0, -1, 0, -1, -1), (0, 0, -1, 0, 1, 1), (0, 0, 1, 0, 1, -1),
)  # fmt: skip
_PAIR: tuple[Factors, ...] = ((0, 0, -1, 0, 1, 0), (0, 0, 1, 0, 1, 0))
FRAMES: dict[int, MotorFrame] = {
    0: MotorFrame("BLUEROV1", (
        *_PAIR, (-0.5, 0.5, 0, 0.45, 0, 0), (0.5, 0.5, 0, 0.45, 0, 0),
        (0, -1, 0, 1, 0, 0), (-0.25, 0, 0, 0, 0, 1),
    )),
    1: MotorFrame(
        "VECTORED", (*_HORIZONTAL, (1, 0, 0, -1, 0, 0), (-1, 0, 0, -1, 0, 0)), coupled=True
    ),
    2: MotorFrame("VECTORED_6DOF", (
        *_HORIZONTAL, (1, -1, 0, -1, 0, 0), (-1, -1, 0, -1, 0, 0),
        (1, 1, 0, -1, 0, 0), (-1, 1, 0, -1, 0, 0),
    ), normalised=True),
    3: MotorFrame("VECTORED_6DOF_90DEG", (
        (1, 1, 0, 1, 0, 0), (0, 0, 1, 0, 1, 0), (1, -1, 0, 1, 0, 0), (0, 0, 0, 0, 0, 1),
        (0, 0, 0, 0, 0, 1), (-1, 1, 0, 1, 0, 0), (0, 0, -1, 0, 1, 0), (-1, -1, 0, 1, 0, 0),
    )),
    4: MotorFrame("SIMPLEROV_3", (*_PAIR, (0, 0, 0, -1, 0, 0))),
    5: MotorFrame("SIMPLEROV_4", (*_PAIR, (1, 0, 0, -1, 0, 0), (-1, 0, 0, -1, 0, 0),
                             (0, 0, 0, 0, 0, 1))),
}  # fmt: skip
FRAMES[6], FRAMES[7] = FRAMES[5], FRAMES[4]
NOTHING = 0.05  # [-] of the longest arm or of the direction: an axis that a thruster hardly moves


def senses(frame: MotorFrame, thrusters: Sequence[Thruster]) -> tuple[float, ...]:
    """[-] For each motor, 1 where its positive output pushes along the thruster's direction, and
    -1 where it pushes against it.

    Raises:
        ValueError: the thrusters of the vehicle file are not the motors of this frame.
    """
    if len(thrusters) != len(frame.motors):
        raise ValueError(
            f"{frame.name} has {len(frame.motors)} motors and the vehicle file has "
            f"{len(thrusters)} thrusters"
        )
    arms = [abs(v) for t in thrusters for v in wrench_per_newton(t)[3:]]
    scales = (1.0, 1.0, 1.0, *[max(*arms, 1e-3)] * 3)
    found: list[float] = []
    for number, (factors, thruster) in enumerate(zip(frame.motors, thrusters, strict=True), 1):
        column = wrench_per_newton(thruster)
        pushes = [SIGN[k] * column[ROW[k]] / scales[ROW[k]] for k in range(6)]
        sense = copysign(1.0, plain_sum(f * push for f, push in zip(factors, pushes, strict=True)))
        agree = all(sense * f * push > NOTHING**2 for f, push in zip(factors, pushes, strict=True)
                    if f)  # fmt: skip
        if not agree:
            raise ValueError(
                f"motor {number} of {frame.name} does not push as thruster {number} of the vehicle "
                f"file, {thruster.name}, does"
            )
        found.append(sense)
    return tuple(found)
