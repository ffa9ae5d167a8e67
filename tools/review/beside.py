"""Lindy's estimate beside the one that was made in the dive."""

import msgspec
import numpy as np

from services.marine.attitude import wrapped
from tools.recordings.columns import Array
from tools.review.recorded import Track, digits

COMPARED = (
    *(("roll", "rad"), ("pitch", "rad"), ("heading", "rad")),
    *(("depth", "m"), ("depth_rate", "m/s"), ("yaw_rate", "rad/s")),
)
ZEROED = ("heading", "depth")  # each counts from its own north and surface
COLUMNS = {"heading": "bearing"}  # of a track, by what is compared
TOGETHER_S = 0.5  # [s] no comparison over a longer pause of ours
FEWEST = 20


class ComparedEstimate(msgspec.Struct, kw_only=True, frozen=True):
    """One quantity: Lindy's minus the vehicle's own."""

    name: str
    unit: str
    rms: float  # root mean square of the difference, without `offset`
    worst: float
    offset: float  # of heading and depth: the middle difference, of two norths and two surfaces
    samples: int


def beside(ours: Track, own: Track) -> list[ComparedEstimate]:
    """Those quantities that both know."""
    found: list[ComparedEstimate] = []
    for name, unit in COMPARED:
        column = COLUMNS.get(name, name)
        t, theirs = own.known(column)
        difference = at(ours, column, t) - theirs
        difference = difference[np.isfinite(difference)]
        if len(difference) >= FEWEST:
            found.append(_compared(name, unit, difference))
    return found


def at(track: Track, name: str, t: Array) -> Array:
    """A track's column at other times; NaN where it has no value near."""
    times, values = track.known(name)
    if not len(times):
        return np.full(len(t), np.nan)
    after = np.clip(np.searchsorted(times, t), 1, max(1, len(times) - 1))
    pause = times[np.minimum(after, len(times) - 1)] - times[after - 1]
    found = np.interp(t, times, values, left=np.nan, right=np.nan)
    return np.where(pause <= TOGETHER_S, found, np.nan)


def _compared(name: str, unit: str, difference: Array) -> ComparedEstimate:
    offset = _middle(name, difference) if name in ZEROED else 0.0
    left = difference - offset
    if unit == "rad":
        left = in_one_turn(left)
    return ComparedEstimate(
        name=name,
        unit=unit,
        rms=digits(float(np.sqrt(np.mean(left**2)))),
        worst=digits(float(np.max(np.abs(left)))),
        offset=digits(offset),
        samples=len(left),
    )


def _middle(name: str, difference: Array) -> float:
    """The middle difference; of headings within half a turn."""
    if name != "heading":
        return float(np.median(difference))
    mean = float(np.angle(np.mean(np.exp(1j * difference))))
    return wrapped(mean + float(np.median(in_one_turn(difference - mean))))


def in_one_turn(angle: Array) -> Array:
    """[rad] in [-π, π)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
