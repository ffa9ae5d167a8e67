"""When a drone was armed while it was recorded. Each such span is one dive of it. Pure."""

from collections.abc import Sequence
from math import inf

import msgspec

from messages import topics
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError
from tools.recordings.progress import reading
from tools.recordings.recording import Recording

BEFORE_S = AFTER_S = 5.0  # [s] of the time beside a dive that is cut out with it
# A link delivers a status late or twice by less than this. What is older is of a drone that was
# started again, and whose clock begins anew.
LATE_NS: Ns = 10_000_000_000
SHOWN = 12  # dives in a sentence


class ArmedSpan(msgspec.Struct):
    """From the first status that says armed to the first that does not."""

    from_s: float  # [s]
    to_s: float  # [s]; where it does not end in the recording, that of the recording
    ended: bool = False

    @property
    def seconds(self) -> float:
        """[s]"""
        return self.to_s - self.from_s

    @property
    def words(self) -> str:
        until = f"{self.to_s:.1f} s" if self.ended else "the end"
        return f"{self.from_s:.1f} s to {until}"


class ArmedSpans:
    """Of one recording, from every status in it, in the order of arrival."""

    def __init__(self) -> None:
        self.found: list[ArmedSpan] = []
        self._newest_ns: Ns | None = None  # stamp

    def see(self, status: VehicleStatus, t: float) -> bool:
        """A status that arrived at `t` [s]. Returns whether it is news; False: it came late, or for
        the second time, and says what was before."""
        newest = self._newest_ns
        if newest is not None and 0 <= newest - status.stamp_ns < LATE_NS:
            return False
        self._newest_ns = status.stamp_ns
        armed = self.found[-1] if self.found and not self.found[-1].ended else None
        if armed is not None:
            armed.to_s, armed.ended = t, not status.armed
        elif status.armed:
            self.found.append(ArmedSpan(t, t))
        return True

    def until(self, end: float) -> list[ArmedSpan]:
        """All of them, of a recording that ends at `end` [s]: a log of another program says that it
        is armed once, and nothing more where its power was lost."""
        if self.found and not self.found[-1].ended:
            self.found[-1].to_s = max(self.found[-1].to_s, end)
        return self.found


def around(spans: Sequence[ArmedSpan], number: int, where: str) -> tuple[float, float]:
    """[s] When the dive of that number, from 1, was, as `lindy log cut --from --to` says it: with
    some seconds before and after it, and nothing of another dive.

    Raises:
        LindyError: there is no such dive.
    """
    if not spans:
        said = f"in {where} no {topics.STATUS.key} says that the drone was armed"
        raise LindyError(f"--dive {number}: {said}")
    if not 1 <= number <= len(spans):
        many = "is 1 dive" if len(spans) == 1 else f"are {len(spans)} dives"
        listed = [f"{n}: {span.words}" for n, span in enumerate(spans[:SHOWN], start=1)]
        listed += [f"and {len(spans) - SHOWN} more"] if len(spans) > SHOWN else []
        raise LindyError(f"--dive {number}: in {where} there {many} ({', '.join(listed)})")
    span = spans[number - 1]
    earliest = spans[number - 2].to_s if number > 1 else 0.0
    latest = spans[number].from_s if number < len(spans) else inf
    to_s = min(span.to_s + AFTER_S, latest) if span.ended else inf
    return max(span.from_s - BEFORE_S, earliest), to_s


def armed_spans(recording: Recording) -> list[ArmedSpan]:
    origin, spans = recording.origin_ns() or 0, ArmedSpans()
    with reading("looking for dives", recording.size) as recording.advance:
        for _, status, log_ns, _ in recording.of(topics.STATUS):
            if isinstance(status, VehicleStatus):
                spans.see(status, (log_ns - origin) / 1e9)
    return spans.found
