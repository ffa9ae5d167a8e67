"""How far the drone's clock is ahead of the topside's, with a bound that holds.

A ping leaves at t1 (topside), is heard at t2 (drone), answered at t3 (drone) and heard back at t4
(topside). Whatever the two delays are, they are not negative, so the drone's clock is ahead by at
least t3 - t4 and at most t2 - t1. Every round trip gives such a band; the truth lies in all of
them, so in their overlap (Marzullo and Owicki 1983). Nothing is assumed about symmetry: a link
that is slow one way only makes the band wide. The best round trip of each direction counts, which
is the minimum filter of NTP (RFC 5905, section 10) for each side by itself.

Crystals differ, so an old band is widened by `DRIFT` for every second of its age.
"""

from dataclasses import dataclass, field

from messages.link import Clock, ClockPong

DRIFT = 100e-6  # [-] two crystals are no further apart: each 50 ppm, over temperature
KEPT = 600  # round trips; two minutes at 5 Hz
SHORTEST_S = 20.0  # [s] between two estimates for a drift worth showing
SILENT_NS = 1_000_000_000  # [ns] without an answer the round trip is not known any more


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """One round trip."""

    number: int  # of the round trips heard
    sent: int  # [ns] t1, topside
    back: int  # [ns] t4, topside
    least: int  # [ns] t3 - t4: the drone's clock is ahead by no less
    most: int  # [ns] t2 - t1: … and by no more
    rtt: int  # [ns] without the drone's own time

    def tells_more_than(self, newer: "RoundTrip") -> bool:
        """Is its band narrower anywhere than that of a newer trip? If not, it never will be."""
        return self.sent > newer.sent or self.least > newer.least or self.most < newer.most


@dataclass(slots=True)
class ClockSync:
    """Fed with pongs; asked for a `Clock`. `events` collects what must be counted."""

    events: list[str] = field(default_factory=list[str])
    _heard: int = 0  # round trips
    _trips: list[RoundTrip] = field(
        default_factory=list[RoundTrip]
    )  # of the last KEPT those that tell most
    _first: tuple[int, float] | None = None  # ([ns] when, [ns] ahead) to measure the drift from

    def heard(self, pong: ClockPong, now: int) -> None:
        """A pong arrived at `now` [ns], topside."""
        trip = RoundTrip(
            number=self._heard,
            sent=pong.ping_ns,
            back=now,
            least=pong.stamp_ns - now,
            most=pong.heard_ns - pong.ping_ns,
            rtt=(now - pong.ping_ns) - (pong.stamp_ns - pong.heard_ns),
        )
        if trip.least > trip.most + DRIFT * (now - trip.sent) + 2:  # stamps are whole nanoseconds
            self.events.append("impossible:clock/pong")
            return
        self._heard += 1
        recent = [old for old in self._trips if old.number > trip.number - KEPT]
        self._trips = [*(old for old in recent if old.tells_more_than(trip)), trip]
        least, most = self._band(now)
        if least > most + 2:
            # No two clocks that run on agree with both: one of them was set.
            self.events.append("jumped:clock")
            self._trips = [trip]
            self._first = None

    def clock(self, now: int) -> Clock:
        """What is known at `now` [ns]; None instead of what would be old or guessed."""
        if not self._trips:
            return _unknown(now)
        least, most = self._band(now)
        ahead = (least + most) / 2
        newest = self._trips[-1]
        answered = now - newest.back
        return Clock(
            stamp_ns=now,
            offset_ns=round(ahead),
            bound_ns=max(0, round((most - least) / 2)) + 2,
            drift_ppm=self._drift(ahead, now),
            rtt_ms=newest.rtt / 1e6 if answered < SILENT_NS else None,
            rtt_min_ms=min(trip.rtt for trip in self._trips) / 1e6,
            answered_ms=max(0.0, answered / 1e6),
        )

    def downward_ms(self, pong: ClockPong, now: int) -> float | None:
        """[ms] How long this ping took down to the drone, by the best knowledge of the clocks."""
        if not self._trips:
            return None
        least, most = self._band(now)
        return max(0.0, (pong.heard_ns - pong.ping_ns - (least + most) / 2) / 1e6)

    def _band(self, now: int) -> tuple[float, float]:
        """[ns] The drone's clock is ahead by no less and no more than this."""
        least = max(trip.least - DRIFT * (now - trip.sent) for trip in self._trips)
        most = min(trip.most + DRIFT * (now - trip.sent) for trip in self._trips)
        return least, most

    def _drift(self, ahead: float, now: int) -> float | None:
        """[ppm] How fast the drone's clock gains on the topside's; None until that can be told."""
        if self._first is None:
            self._first = (now, ahead)
        since, then = self._first
        if now - since < SHORTEST_S * 1e9:
            return None
        return (ahead - then) / (now - since) * 1e6


def _unknown(now: int) -> Clock:
    return Clock(
        stamp_ns=now,
        offset_ns=None,
        bound_ns=None,
        drift_ppm=None,
        rtt_ms=None,
        rtt_min_ms=None,
        answered_ms=None,
    )
