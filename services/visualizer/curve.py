"""One curve: how to read its numbers from a message, and how it is drawn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any

from messages.message import Estimate
from messages.topic import AnyTopic

CurveRow = Sequence[float]
Read = Callable[[Any], CurveRow | None]

# One colour per meaning, in every panel and in the scene. RGB.
REFERENCE, ESTIMATE, TRUTH = 0xFF9F2E, 0x4CA6FF, 0x9AA0A6
AXES = (0xEF6C6C, 0x66C285, 0x6C9DF0, 0xE0B04C, 0xB57EDC, 0x4FC4C4)
DOWN, UP, STICK = 0x5FD0C0, 0xC58BE8, 0xF2D34F
PREDICTED = 0xFF6FD8  # predicted present state: a colour of its own, because a pilot steers by it
TRUTHS = (0xB23B3B, 0x2F8F52, 0x3B66C4)  # of several axes in one panel: each axis, darker
BOUND = 0xC8CCD0  # the second line of a pair of limits
MANY = (*AXES, 0xF2D34F, 0xB6E34A, 0xF27FB2, 0xE8E8E8, 0xB08968, 0x7F8C8D)  # thrusters, services
LONGEST_MS = 60_000.0  # [ms] anything longer is a wrong stamp, not a latency


@dataclass(frozen=True, slots=True)
class Look:
    """How curves that share an entity are drawn; their numbers are computed from many messages."""

    path: str
    names: tuple[str, ...]
    colours: tuple[int, ...]
    width: float = 1.5  # [px]


@dataclass(frozen=True, slots=True)
class Curve:
    """Curves that are read from one message; they share an entity."""

    path: str
    topic: AnyTopic
    names: tuple[str, ...]
    colours: tuple[int, ...]
    read: Read
    width: float = 1.5  # [px]
    in_parts: bool = False  # a message that does not have it is of another source: no gap


def known(estimate: Estimate | None, unit: Callable[[float], float] = float) -> CurveRow | None:
    return None if estimate is None or not estimate.valid else (unit(estimate.value),)


def number(value: float | None) -> CurveRow | None:
    return None if value is None else (value,)


def in_degrees(radians: CurveRow) -> CurveRow:
    return [degrees(value) for value in radians]


def way_ms(begin: int | None, end: int | None) -> CurveRow | None:
    if begin is None or end is None:
        return None
    way = (end - begin) / 1e6
    return (way,) if 0.0 <= way <= LONGEST_MS else None
