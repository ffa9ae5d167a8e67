"""The set-ups of the papers' figures: printed values where there are any, ours where not.

Figures and claims share them, so a claim is about the figure that is drawn.
"""

from math import exp

from lindy.api.references import Limits, MotionRequest, plan
from services.reference.paths.path import Path
from services.reference.paths.turn import SmoothTurn
from tools.generators.route import ProfileSequence, Route, TwinClothoids, sequence

# Andrén 2023, figures 4.2 and 4.3.
JERK = 10.0  # [m/s³]
SMALL_STEP, LARGE_STEP = 0.1, 1.0  # [m/s]
FILTER_FREQUENCY = 10.0  # [rad/s] so that the filter begins the small step with 10 m/s³
FILTER_DAMPING = 0.8  # [-] not printed; the text's overshoot needs less than 1

# Andrén 2023, figures 5.1 to 5.5: a change of velocity of 1 m/s.
FIXED_TIME = 1.0  # [s]
END_JERK = 6.0  # [m/s³] not printed; from rest, 1 m/s then takes 1 s, as in the figures before

# Andrén 2023, figures 5.8 and 5.9; not printed.
CLAMPED = Limits(1.0, 0.5)  # [m/s³], [m/s²]
CLAMPED_TARGETS = (0.5, 1.0, 1.5, 2.0)  # [m/s]

# Fernandes et al. 2015.
XI = 10.0  # [-] ξ_a and ξ_d; the paper allows 10 to 15. 10 is nearest to its Table 3
SEA_TRIAL = MotionRequest(
    length=50.0, cruise=0.3, accel_time=20.0, decel_time=20.0, epsilon=0.05, theta_a=0.8,
    theta_d=0.2, theta_0=exp(-100 / 9), xi_a=XI, xi_d=XI,
)  # fmt: skip
TABLE_2_BEGIN = 15.0  # [s]
TABLE_3_BEGIN = 50.0  # [s]
WAYPOINTS = ((0.0, 0.0), (60.0, 0.0), (0.0, 90.0), (60.0, 90.0))  # [m] Table 4
MIN_RADIUS = 10.0  # [m]
LANE_OFFSET = 10.0  # [m] of figure 5; not printed


def advanced(
    length: float, cruise: float, initial: float, final: float, time: float, xi: float = XI
) -> MotionRequest:
    """A column of Table 2 or 3; `time` [s] is T_a and T_d."""
    return MotionRequest(
        length=length, cruise=cruise, initial=initial, final=final, accel_time=time,
        decel_time=time, epsilon=0.05, theta_a=0.8, theta_d=0.2, theta_0=exp(-13), xi_a=xi, xi_d=xi,
    )  # fmt: skip


def table_2() -> ProfileSequence:
    """The motion of figure 9, from its own 0 s."""
    columns = ((100.0, 2.0, 0.0, 1.0), (50.0, 1.0, 1.0, 1.0), (100.0, 1.5, 1.0, 0.0))
    return sequence([plan(advanced(*column, time=10.0)) for column in columns])


def paper_path(*, smooth_yaw: bool = False) -> Path:
    """The path of Table 4."""
    return Path.through(WAYPOINTS, MIN_RADIUS, shape=SmoothTurn if smooth_yaw else TwinClothoids)


def table_3(path: Path, xi: float = XI) -> list[MotionRequest]:
    """One request for each part of the path of Table 4."""
    speeds = ((0.4, 0.0, 0.25), (0.25, 0.25, 0.25), (0.4, 0.25, 0.25), (0.25, 0.25, 0.25),
              (0.4, 0.25, 0.0))  # fmt: skip
    return [
        advanced(part.length, *speed, time=20.0, xi=xi)
        for part, speed in zip(path.parts, speeds, strict=True)
    ]


def paper_route(*, smooth_yaw: bool = False) -> Route:
    """The motion of Table 3 along the path of Table 4, from its own 0 s."""
    path = paper_path(smooth_yaw=smooth_yaw)
    return Route(path, sequence([plan(request) for request in table_3(path)]))
