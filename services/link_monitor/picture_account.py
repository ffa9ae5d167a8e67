"""How old the picture of each camera is when it is whole, stage by stage, and what the link lets
through of it. Pure: time is an argument."""

from dataclasses import dataclass, field
from itertools import pairwise

from messages import events
from messages.events import Outbox
from messages.link import Stage
from messages.units import Ns
from messages.video import HEADERS, PICTURE_STAGES, PictureAge, UnitStream, VideoPart

TOTAL = "light to picture"
MOST_KBIT = 1e6  # [kbit/s] parts that arrive at one instant
MOST_MISSING = 1000  # messages: a greater gap is a sender that began anew


@dataclass(slots=True)
class Carried:
    """What has arrived of the pictures of all cameras: it all takes the same way."""

    bytes: int = 0  # with headers


@dataclass(slots=True)
class _Period:
    """Since the last report."""

    stages: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])  # [ms]
    totals: list[float] = field(default_factory=list[float])  # [ms]
    heard: int = 0  # messages
    missing: int = 0  # messages
    bytes: int = 0
    train_bytes: int = 0  # of parts behind the first of their picture …
    train_ns: int = 0  # … which took so long


class PictureAccount:
    """The pictures of one camera."""

    def __init__(self, outbox: Outbox, carried: Carried | None = None) -> None:
        """
        Args:
            carried: shared by the accounts of all cameras.
        """
        self._outbox = outbox
        self._carried = Carried() if carried is None else carried
        self._units = UnitStream()
        self._period = _Period()
        self._began_ns: Ns = 0  # [ns] of the period
        self._train: tuple[Ns, Ns, int] | None = None  # stamp, arrival of the first part, carried
        self._seq: int | None = None
        self._newest: int | None = None
        self._picture: VideoPart | None = None  # newest picture that can be decoded

    @property
    def begun(self) -> bool:
        """Has anything arrived?"""
        return self._newest is not None

    @property
    def broken(self) -> bool:
        return self._units.broken

    def take(self, part: VideoPart, now: Ns) -> None:
        """A part has arrived."""
        self._measure(part, now)
        units = self._units
        dropped, undecodable = units.dropped, units.undecodable
        unit = units.take(part)
        self._outbox.tell(events.DROPPED_PICTURE(), units.dropped - dropped)
        self._outbox.tell(events.UNDECODABLE("picture"), units.undecodable - undecodable)
        if unit is None:
            return
        self._picture = about = unit.about
        times = about.stamp_ns, about.captured_ns, about.encoded_ns, now
        self._period.stages.append(tuple(_ms(begin, end) for begin, end in pairwise(times)))
        self._period.totals.append(_ms(about.stamp_ns, now))

    def report(self, now: Ns) -> PictureAge:
        """What happened since the last report; a new period begins."""
        period, self._period = self._period, _Period()
        seconds = max((now - self._began_ns) / 1e9, 1e-3)
        self._began_ns = now
        expected = period.heard + period.missing
        shown = self._picture
        age = None if shown is None else _ms(shown.stamp_ns, now)
        columns = zip(*period.stages, strict=True)
        stages = tuple(_stage(*each) for each in zip(PICTURE_STAGES, columns, strict=False))
        return PictureAge(
            stamp_ns=now,
            picture_ns=None if shown is None else shown.stamp_ns,
            age_ms=age,
            exact=shown is not None and shown.exact,
            stages=stages or None,
            total=_stage(TOTAL, tuple(period.totals)) if period.totals else None,
            per_second=len(period.totals) / seconds,
            heard_kbit=period.bytes * 8e-3 / seconds,
            # Pace at which parts behind the first one arrive.
            room_kbit=min(MOST_KBIT, period.train_bytes * 8e6 / max(period.train_ns, 1))
            if period.train_bytes
            else None,
            lost=period.missing / expected if expected else 0.0,
            newest=self._newest,
            keyframe_wanted=self.broken,
        )

    def _measure(self, part: VideoPart, now: Ns) -> None:
        period = self._period
        period.heard += 1
        period.bytes += len(part.data)
        self._carried.bytes += len(part.data) + HEADERS
        if self._seq is not None and 0 < part.seq - self._seq - 1 < MOST_MISSING:
            period.missing += part.seq - self._seq - 1
        self._seq, self._newest = part.seq, part.picture
        if self._train is None or self._train[0] != part.stamp_ns:
            self._train = part.stamp_ns, now, self._carried.bytes
            return
        if part.part == part.parts - 1:
            _, began, carried = self._train
            period.train_bytes += self._carried.bytes - carried
            period.train_ns += now - began


def _stage(name: str, values: tuple[float, ...]) -> Stage:
    ordered = sorted(values)
    return Stage(name, ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100])


def _ms(begin: Ns, end: Ns) -> float:
    """[ms] Never negative: two clocks are known to within some time only."""
    return max(0.0, (end - begin) / 1e6)
