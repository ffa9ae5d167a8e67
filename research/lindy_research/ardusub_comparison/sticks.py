"""The heave stick of both flights."""

from typing import NamedTuple

GO_S, REST_S = 3.0, 8.0  # [s] of full stick, and centred after it
FIRST_S = 12.0  # [s] of rest after the first descent, which is not judged
DIRECTIONS = (1, 1, -1, -1, 1, 1, -1, -1)  # of the judged releases; 1 is down
DESCENT_S = 4.5  # [s] of full stick from the surface
WAIT_S = 1.0  # [s] before anything


class StickMove(NamedTuple):
    at: float  # [s] since the sticks were handed over
    heave: float  # [-] -1 … 1, down


def judged() -> list[StickMove]:
    """From the surface to about 4 m, then eight releases at full speed, all below 2 m."""
    return _moves(DIRECTIONS, 1.0, GO_S)


def practice() -> list[StickMove]:
    """Others, for settings: what is judged is not what they were found with."""
    return _moves((1, -1, 1, -1), 0.9, 2.5)


def _moves(directions: tuple[int, ...], size: float, seconds: float) -> list[StickMove]:
    moves = [StickMove(0.0, 0.0), StickMove(WAIT_S, 1.0), StickMove(WAIT_S + DESCENT_S, 0.0)]
    at = WAIT_S + DESCENT_S + FIRST_S
    for direction in directions:
        moves += [StickMove(at, size * direction), StickMove(at + seconds, 0.0)]
        at += seconds + REST_S
    return [*moves, StickMove(at, 0.0)]


def heave_at(moves: list[StickMove], t: float) -> float:
    """[-] Of the newest move at `t` [s]."""
    return next((move.heave for move in reversed(moves) if move.at <= t), 0.0)
