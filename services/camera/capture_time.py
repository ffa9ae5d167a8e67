"""When the light of a picture arrived, as far as its source tells. Pure: arrivals are arguments.

A picture that waited, wherever that was, comes later after its source's own time than the one that
came quickest. So no queue passes for a fresh picture, though the quickest way itself stays unknown.
A source that says when the light arrived (V4L2; RTP, by its sender reports) is believed where that
can be true: its clock has to be set."""

from dataclasses import dataclass
from typing import NamedTuple

from messages.units import Ns

LEAK = 1e-3  # [-] by which the quickest way may become longer: two clocks never run alike
BACK_NS = 1_000_000_000  # [ns] a source's time that steps back so far has begun anew
EARLY_NS = 2_000_000_000  # [ns] before its arrival at most: earlier, the source's clock is not set
AHEAD_NS = 50_000_000  # [ns] after it at most: two clocks that are set differ by some
# [ns] A source whose pictures come so much later than at first is opened anew, without its queue.
BEHIND_NS = 2_000_000_000
LONGEST_WAIT_NS = 500_000_000  # [ns] pictures that come so late are left out up to a keyframe


class Light(NamedTuple):
    at_ns: Ns  # never after the arrival
    exact: bool  # the source has said so; False: the light is as old or older
    stripe: bool = False  # we have drawn it into the picture, as `services.marine.time_stripe`


@dataclass(slots=True)
class CaptureTime:
    """The clock of one source, from its opening on."""

    _quickest: float | None = None  # [ns] least of arrival minus source time
    _newest: Ns = 0  # [ns] source time
    _heard: Ns = 0

    def light(self, own_ns: Ns | None, said_ns: Ns | None, arrived: Ns) -> Light:
        """When the light of a picture that has arrived was there.

        Args:
            own_ns: by any clock of its source; None: it has none.
            said_ns: when the light arrived, by our clock, as the source says; None: it does not.
        """
        at = arrived if own_ns is None else self._by_source(own_ns, arrived)
        if said_ns is None or not arrived - EARLY_NS < said_ns <= arrived + AHEAD_NS:
            return Light(at, exact=False)
        return Light(min(at, said_ns), exact=True)

    def _by_source(self, own_ns: Ns, arrived: Ns) -> Ns:
        way = float(arrived - own_ns)
        if self._quickest is None or own_ns < self._newest - BACK_NS:
            self._quickest, self._newest = way, own_ns
        else:
            leak = LEAK * (arrived - self._heard)
            self._quickest = min(way, self._quickest + leak)
            self._newest = max(self._newest, own_ns)
        self._heard = arrived
        return min(arrived, own_ns + round(self._quickest))
