"""The account of the pictures that arrive. Pure: time is an argument."""

from dataclasses import dataclass, field
from itertools import pairwise

from messages import events
from messages.events import Outbox
from messages.link import Stage
from messages.units import Ns
from messages.video import HEADERS, PICTURE_STAGES, PictureAge, UnitStream, VideoPart
from services.vehicle_view import ages

TOTAL = "light to picture"
OLD_MS = ages.STATE.grey_ns / 1e6  # [ms] an older picture is said to be old, as on the page
SMALL_OLD_MS = ages.PICTURE.gone_ns / 1e6  # [ms] … of a small one
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
    """Of one camera."""

    def __init__(self, outbox: Outbox, carried: Carried | None = None, called: str = "") -> None:
        """
        Args:
            carried: shared by the accounts of all cameras.
            called: the camera, before every word about its picture; empty: there is one only.
        """
        self._outbox = outbox
        self._carried = Carried() if carried is None else carried
        self._called = called
        self._units = UnitStream()
        self._period = _Period()
        self._began_ns: Ns = 0  # [ns] of the period
        self._train: tuple[Ns, Ns, int] | None = None  # stamp, arrival of the first part, carried
        self._seq: int | None = None
        self._newest: int | None = None
        self._picture: VideoPart | None = None  # newest picture that can be decoded

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

    def report(self, now: Ns, *, small: bool = False, roomless: bool = False) -> PictureAge:
        """What happened since the last report; a new period begins.

        Args:
            small: the picture is a small one, which may be a slide show.
            roomless: the camera sends nothing because the link has no room for it.
        """
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
            words=self._words(age, small=small, roomless=roomless),
        )

    def _words(self, age: float | None, *, small: bool, roomless: bool) -> str:
        words, oldest = "", SMALL_OLD_MS if small else OLD_MS
        if roomless:
            words = "the link has no room for its picture"
        elif self._picture is None or age is None:
            arrived = self._newest is not None
            words = "no picture could be decoded" if arrived else "no picture has arrived"
        elif age > oldest:
            why = ", and no newer one can be decoded" if self.broken else ""
            least = "" if self._picture.exact else "at least "
            words = f"the picture is {least}{age / 1e3:.1f} s old{why}"
        return f"{self._called}: {words}" if words and self._called else words

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
