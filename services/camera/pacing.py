"""How much each camera may send, and which pictures are sent: never more bytes than the bitrate
allows, whatever the encoder makes.

One camera is large, which the pilot flies by; the others are small. From what the bitrate law
leaves for all pictures together (`total_kbit`):

1. The small ones have SMALL of it: each its least bitrate, and of the rest equal parts. What is
   more than its most is the large one's.
2. Where the large one would then have less than ENOUGH, they have only what is above ENOUGH, down
   to their least bitrates, which is a picture or two a second.
3. Where even these are more than SMALL of it, small cameras get nothing, the last named first.

So the large one never has less than 1 - SMALL of it, and the sum is never more than all of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from messages.units import Ns
from services.marine.summation import plain_sum

SMALL = 0.3  # [-] of the room, for all small pictures together
ENOUGH_KBIT = 250.0  # [kbit/s] with which the large picture comes 25 times a second


class Range(NamedTuple):
    """Limits of a camera's bitrate."""

    least_kbit: float  # [kbit/s]
    most_kbit: float  # [kbit/s]


def shares(total_kbit: float, large: str, cameras: Mapping[str, Range]) -> dict[str, float]:
    """[kbit/s] For each camera. 0: it is to send nothing.

    Args:
        total_kbit: [kbit/s] for the pictures of all cameras.
        large: one of the cameras.
        cameras: in the order of the vehicle file.
    """
    small = {name: bounds for name, bounds in cameras.items() if name != large}
    most = SMALL * total_kbit
    while small and _least(small) > most:
        small.popitem()
    given = dict.fromkeys(cameras, 0.0)
    rest = min(most, max(total_kbit - ENOUGH_KBIT, _least(small))) - _least(small)
    for name, bounds in small.items():
        given[name] = min(bounds.most_kbit, bounds.least_kbit + rest / len(small))
    given[large] = total_kbit - plain_sum(given.values())
    return given


def _least(cameras: Mapping[str, Range]) -> float:
    return plain_sum(bounds.least_kbit for bounds in cameras.values())


STEP = 1.1  # [-] more bitrate that is worth a change of the encoder's: it costs a keyframe
WORTH_KBIT = 10.0  # [kbit] of a picture that can be recognised; below it fewer pictures are better
BURST_NS = 100_000_000  # [ns] of the bitrate that may be sent ahead
EARLY = 0.3  # [-] of the time between two pictures
KEYFRAME_SHARE = 0.2  # [-] of the bitrate that regular keyframes may take
KEYFRAME_NS = 2_000_000_000  # [ns] between two of them at least
BLOCKS_MS = 20.0  # [ms] for which one part may hold back telemetry that is more urgent
MEASURED = 700  # [B] of a picture that comes in two parts at least
SMALLEST, LARGEST = 1200, 16_000  # [B] of one part: a packet of the network, or several


def encoder_kbit(budget: float, before: float) -> float:
    """[kbit/s] The encoder's bitrate for a budget: the one before until that is too much, or more
    is worth a change."""
    return before if before <= budget < STEP * before else budget


def pictures_per_second(kbit: float, most: float) -> float:
    """[1/s] For this bitrate [kbit/s]."""
    return min(most, kbit / WORTH_KBIT)


def split(data: bytes, room_kbit: float) -> list[bytes]:
    """An access unit in parts of about the same size. None occupies the link for long, and there
    are two or more, so that the pace of their arrival can be measured."""
    size = min(max(round(room_kbit * BLOCKS_MS / 8.0), SMALLEST), LARGEST)
    number = max(2 if len(data) > MEASURED else 1, -(-len(data) // size))
    size = max(1, -(-len(data) // number))
    return [data[at : at + size] for at in range(0, len(data), size)]


@dataclass(slots=True)
class Pacer:
    """Says when the next picture may be sent, and when it should be a keyframe."""

    _free_at: Ns = 0  # [ns] when all that was sent is paid for, at the bitrate
    _due: Ns = 0  # [ns] of the next picture
    _keyframe_due: Ns | None = None

    def admits(self, now: Ns, hz: float) -> bool:
        """May a picture be sent now?

        Args:
            hz: [1/s] pictures wanted.
        """
        period = 1e9 / hz
        # Pictures come when the camera has them: one that is a little early is in time.
        in_time = now >= min(self._due, now + period) - EARLY * period
        return in_time and now + BURST_NS >= self._free_at

    def wants_keyframe(self, now: Ns) -> bool:
        return self._keyframe_due is None or now >= self._keyframe_due

    def sent(self, size: int, kbit: float, hz: float, *, keyframe: bool, now: Ns) -> None:
        """A picture of `size` [B], headers included, was sent at a bitrate [kbit/s]."""
        takes = round(size * 8e6 / kbit)  # [ns]
        period = round(1e9 / hz)
        self._free_at = max(now, self._free_at) + takes
        self._due = max(self._due, now - period) + period
        if keyframe:
            self._keyframe_due = now + max(KEYFRAME_NS, round(takes / KEYFRAME_SHARE))
