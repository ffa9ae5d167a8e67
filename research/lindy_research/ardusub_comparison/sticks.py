"""The sticks of both flights."""

from random import Random
from typing import NamedTuple

GO_S, REST_S = 3.0, 8.0  # [s] of full stick, and centred after it
FIRST_S = 12.0  # [s] of rest after the first descent, which is not judged
DIRECTIONS = (1, 1, -1, -1, 1, 1, -1, -1)  # of the judged releases; 1 is down
DESCENT_S = 4.5  # [s] of full stick from the surface
WAIT_S = 1.0  # [s] before anything
SHALLOW, DEEP = 4.0, 9.0  # [m] between which random dives keep the drone
FULL_SPEED = 0.97  # [m/s] of heave at full stick
# What random dives let go: these axes, and of those the ones that are kept pushed.
KINDS = (
    ("heave", ""),
    ("surge", ""),
    ("surge heave", ""),
    ("surge heave", "surge"),
    ("yaw", ""),
    ("surge yaw", ""),
)


class StickMove(NamedTuple):
    at: float  # [s] since the sticks were handed over
    heave: float = 0.0  # [-] -1 … 1, down
    surge: float = 0.0  # [-] forward
    yaw: float = 0.0  # [-] to starboard


def judged() -> list[StickMove]:
    """From the surface to about 4 m, then eight releases of full heave stick, all below 2 m."""
    moves, at = _descent()
    for direction in DIRECTIONS:
        moves += [StickMove(at, direction), StickMove(at + GO_S)]
        at += GO_S + REST_S
    return [*moves, StickMove(at)]


def drawn(seed: int, rounds: int) -> list[StickMove]:
    """From the surface to about 4 m, then of each of KINDS as many releases as there are rounds, in
    random order, with random sticks for random times."""
    random, (moves, at), depth = Random(seed), _descent(), FULL_SPEED * DESCENT_S
    kinds = [kind for _ in range(rounds) for kind in KINDS]
    random.shuffle(kinds)
    for axes, kept in kinds:
        sticks = {axis: random.choice((-1, 1)) * random.uniform(0.5, 1.0) for axis in axes.split()}
        seconds = random.uniform(2.0, 4.0)
        if "heave" in sticks:
            way = abs(sticks["heave"]) * FULL_SPEED * seconds
            down = depth + way < DEEP and (depth - way < SHALLOW or sticks["heave"] > 0.0)
            sticks["heave"] = abs(sticks["heave"]) if down else -abs(sticks["heave"])
            depth += way if down else -way
        moves += [StickMove(at, **sticks)]
        at += seconds
        if kept:
            moves.append(StickMove(at, **{kept: sticks[kept]}))
            at += REST_S
        moves.append(StickMove(at))
        at += REST_S
    return [*moves, StickMove(at)]


def _descent() -> tuple[list[StickMove], float]:
    """And when it is over [s]."""
    moves = [StickMove(0.0), StickMove(WAIT_S, 1.0), StickMove(WAIT_S + DESCENT_S)]
    return moves, WAIT_S + DESCENT_S + FIRST_S


def sticks_at(moves: list[StickMove], t: float) -> StickMove:
    """The newest move at `t` [s]."""
    return next((move for move in reversed(moves) if move.at <= t), StickMove(t))
