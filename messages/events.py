"""Every event, once: what can happen in a dive that a person or a program must know of.

A core tells an event to its `Outbox`: `outbox.tell(events.FROZEN("sensor/pressure"))`. It is counted
in `Health.counts` under its name, `frozen:sensor/pressure`, and where its row says so it also
becomes a line of the log, which carries the name. Terminal, page, ground stations, summary, report
and docs/failsafes.md take sentence, severity and advice from the row, by the name.

A row stands for one event, `alarm:link`, or for a kind of events, `frozen`, whose subject the
caller gives. A row of its own goes before that of its kind.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from enum import IntEnum
from typing import Literal, NamedTuple

from messages.message import Notice
from messages.vehicle import Reaction, Returns

Level = Literal["info", "warning", "error"]
# What a dive promises, and an event of a row can break; the report says how the dive ended by it.
Promise = Literal["piloted", "answered", "recorded", "understood"]


class Severity(IntEnum):
    """Most important first."""

    FAILSAFE = 0  # the drone acted by itself
    DANGER = 1  # a part of the drone or of the link cannot be relied on
    DATA = 2  # the recording is incomplete
    PILOT = 3  # something the pilot asked for was not done
    SENSOR = 4  # a measurement was not used
    LIMIT = 5  # a value was at its limit
    MESSAGE = 6  # a message was not used
    ROUTINE = 7  # normal in any dive


FAILSAFE, DANGER, DATA, PILOT, SENSOR, LIMIT, MESSAGE, ROUTINE = Severity


class Row(NamedTuple):
    """One event, or one kind of events."""

    name: str  # kind, or kind:subject
    severity: Severity
    sentence: str  # what happened, in a few literal words
    to_do: str = ""  # what the pilot can do; empty: nothing
    said: Level | None = None  # also a line of the log; None: only counted
    breaks: Promise | None = None
    short: str = ""  # in two or three words, for a small screen; default: the name's

    def __call__(self, subject: str = "", *, detail: str = "") -> "Event":
        """An event of this row.

        Args:
            subject: which sensor, thruster, key, axis … it concerns; empty where the row names it.
            detail: the values of this one time, such as `12 % left`; shown, and not counted apart.
        """
        return Event(f"{self.name}:{subject}" if subject else self.name, detail)

    @property
    def kind(self) -> str:
        return self.name.partition(":")[0]


class Event(NamedTuple):
    """Something that has happened, once."""

    name: str  # kind or kind:subject, as in `Health.counts`
    detail: str = ""

    @property
    def row(self) -> Row:
        return row_of(self.name)

    @property
    def sentence(self) -> str:
        """What a person reads of it."""
        return sentence(self.name, self.detail)


class Outbox:
    """What a core has to tell: the one way of an event out of it.

    A service hands the outbox of its node to its cores. Counts are those of `Health`; the node
    publishes what is said after each step. That outbox may be told on any thread.
    """

    __slots__ = ("_lock", "also", "counts", "said")

    def __init__(
        self,
        counts: Counter[str] | None = None,
        lock: AbstractContextManager[object] = nullcontext(),  # noqa: B008 - it has no state
    ) -> None:
        """
        Args:
            counts: into which it counts; default: a new one.
            lock: of the threads that tell it something.
        """
        self.counts: Counter[str] = Counter() if counts is None else counts
        self.said: deque[tuple[Level, str, str]] = deque()  # level, text, the event's name
        # Hears each line at once: a service with a screen of its own, which is not sent its own.
        self.also: Callable[[Level, str, str], None] = lambda _level, _text, _name: None
        self._lock = lock

    def tell(self, event: Event | None, times: int = 1) -> None:
        """Count it, and say it where its row is one that is said. None: nothing happened."""
        if event is None or not times:
            return
        self.count(event, times)
        if (level := event.row.said) is not None:
            self._say(level, event.sentence, event.name)

    def count(self, event: Event, times: int = 1) -> None:
        """Count it alone, where it has been said before or comes with every stick position."""
        with self._lock:
            self.counts[event.name] += times

    def say(self, level: Level, text: str) -> None:
        """A line of the log that is no event: what a service does, or is set up with."""
        self._say(level, text, "")

    def _say(self, level: Level, text: str, name: str) -> None:
        self.said.append((level, text, name))
        self.also(level, text, name)


ALL: dict[str, Row] = {}  # by name


def row(
    name: str,
    severity: Severity,
    sentence: str,
    to_do: str = "",
    *,
    said: Level | None = None,
    breaks: Promise | None = None,
    short: str = "",
) -> Row:
    """A row of the table."""
    assert name not in ALL, name
    ALL[name] = Row(name, severity, sentence, to_do, said, breaks, short)
    return ALL[name]


def row_of(name: str) -> Row:
    """The row of an event, or of its kind; an unknown name, as of a user's own service, is shown as
    it is."""
    kind = name.partition(":")[0]
    return ALL.get(name) or ALL.get(kind) or Row(kind, SENSOR, kind)


def troubles(counts: Mapping[str, int]) -> int:
    """How much of what a service has counted is not normal in any dive. What never arrived is not of
    the service: of that, `LatencyBudget.lost_s` tells what a person lacked."""
    each = ((row_of(name), number) for name, number in counts.items())
    return sum(number for row, number in each if row.severity < ROUTINE and row is not LOST)


def known(name: str) -> bool:
    """Is there a row for it?"""
    return name in ALL or name.partition(":")[0] in ALL


def sentence(name: str, detail: str = "") -> str:
    """What happened, to what where the row does not say so, and with which values."""
    kind, _, subject = name.partition(":")
    words = row_of(name).sentence
    if subject and name not in ALL and kind in ALL:
        words = f"{words} ({subject})"
    joint = "; " if ":" in words else ": "
    return f"{words}{joint}{detail}" if detail else words


# What a pilot is told that is no event, by its code; {s}: a number of this name.
TOLD = {
    "no_status": "no status from the drone yet",
    "calibrating": "calibrating: keep the drone still",
    "no_state": "not ready: no usable samples of the drone's IMU, or estimation does not run",
    "not_ready": "not ready: see the warning of estimation",
    "link.never": "no answer from the drone yet",
    "link.silent": "no answer from the drone for {s} s",
    "link.rtt": "round trip has risen from {from} to {to} ms",
}
# Other numbers of a notice, by their names.
AMOUNTS = {
    "left": "{:.0%} left", "m": "{:g} m", "celsius": "{:g} °C", "wait_s": "{:g} s to go",
    "hz": "{:g} a second",
}  # fmt: skip


def detail(notice: Notice) -> str:
    """What a notice says beside its sentence; empty: nothing."""
    numbers = notice.numbers.items()
    amounts = [AMOUNTS[name].format(value) for name, value in numbers if name in AMOUNTS]
    about = [sentence(each) if known(each) else each for each in notice.about]
    return ", ".join(filter(None, [*amounts, *about, notice.more]))


def told(notice: Notice) -> str:
    """A notice in English."""
    words = TOLD.get(notice.code) or sentence(notice.code)
    for name, value in notice.numbers.items():
        words = words.replace(f"{{{name}}}", f"{value:g}")
    more = detail(notice)
    return f"{words} ({more})" if more else words


def note(notices: Iterable[Notice]) -> str:
    """All of them in English."""
    return "; ".join(map(told, notices))


def short(name: str) -> str:
    """In two or three words."""
    found = row_of(name)
    subject = name.partition(":")[2]
    if found.kind == HUNG.name:
        return f"{subject} did not answer"
    return found.short or subject.replace("_", " ") or name


# Conditions that the failsafe table watches (services/reference/failsafe/table.py). Each has two
# rows with the same sentence: it was noticed, and the drone acted.


class Condition(NamedTuple):
    """What the failsafe table watches for."""

    name: str
    noticed: Row
    acted: Row

    @property
    def sentence(self) -> str:
        return self.noticed.sentence


CONDITIONS: dict[str, Condition] = {}


def _condition(
    name: str, sentence: str, to_do: str = "", *, severity: Severity = DANGER, short: str = ""
) -> Condition:
    noticed = row(
        *(f"notice:{name}", severity, sentence, to_do),
        said="warning",
        short=short,
    )
    acted = row(
        *(f"failsafe:{name}", FAILSAFE, sentence, to_do),
        said="warning",
        breaks="piloted",
        short=short,
    )
    CONDITIONS[name] = Condition(name, noticed, acted)
    return CONDITIONS[name]


# fmt: off
FAILSAFE_ACTED = row("failsafe", FAILSAFE, "the drone acted by itself", breaks="piloted")
LEAK = _condition(
    "leak", "water in the enclosure", "bring the drone up and out of the water", short="leak")
BATTERY_CRITICAL = _condition(
    "battery_critical", "the battery is nearly empty", "bring the drone up",
    short="battery critical")
STATE_LOST = _condition(
    "state_lost", "drone's state lost: its motion is not known",
    "wait for the state, then resume; or disarm", short="drone's state lost")
IMU_LOST = _condition(
    "imu_lost", "the IMU cannot be used: no attitude and heading, depth from pressure alone",
    "resume to rise with the sticks; disarm at the surface", short="IMU lost")
LINK_LOST = _condition(
    "link_lost", "link lost: nothing arrives from topside", "check the tether", short="link lost")
PILOT_LOST = _condition(
    "pilot_lost", "pilot lost: no stick positions arrive", "centre the sticks and resume",
    short="pilot lost")
DEPTH_LIMIT = _condition(
    "depth_limit", "the depth limit: the drone goes no deeper", "rise, or set another limit",
    severity=PILOT)
TOO_DEEP = _condition("too_deep", "the drone is deeper than its limit", "rise")
FLOOR_LIMIT = _condition(
    "floor_limit", "the bottom is close: the stick leads no deeper",
    "rise; to land, type a depth or choose manual", severity=PILOT)
NEAR_FLOOR = _condition("near_floor", "the bottom is close", "rise", severity=PILOT)
DEPTH_LOST = _condition("depth_lost", "the depth is not known and not held", "hold it by hand")
HEADING_LOST = _condition(
    "heading_lost", "the heading is not known and not held", "hold it by hand")
SENSOR_TROUBLE = _condition("sensor", "a sensor is in trouble", "hold by hand what it measures")
CONTROL_SILENT = _condition(
    "control_silent", "control does not answer: the thrusters have stopped", "wait, or disarm")
BOARD_SILENT = _condition(
    "board_silent", "the vehicle's board does not answer", "check the board's power and cable")
# While one of these holds, nobody obeys the reference.
UNMOVED = frozenset({CONTROL_SILENT.name, BOARD_SILENT.name})
SERVICE_SILENT = _condition("service_silent", "a service on board does not answer", "come back")
SERVICE_LATE = _condition(
    "service_late", "a service on board is late", "end other programs on the drone's computer")
RECORDER_DOWN = _condition(
    "recorder_down", "the recorder does not answer", "come back if the recording matters",
    severity=DATA)
DISK_FULL = _condition(
    "disk_full", "the recording cannot be written to the disk", "free some of the disk",
    severity=DATA)
CLOCK_JUMP = _condition("clock_jump", "a computer's clock has jumped")
BATTERY_LOW = _condition("battery_low", "the battery is low", "come back")
TOO_HOT = _condition("too_hot", "the enclosure is too hot", "rest the thrusters, or come back")

# What a failsafe makes the drone do.
DOES: dict[Reaction, str] = {
    "stop": "the drone has stopped and holds",
    "ascend": "the drone rises slowly",
    "surface": "the drone stays at the surface",
}
# What the pilot does to have the sticks again.
RETURN: dict[Returns, str] = {
    "centre": "centre the sticks to continue",
    "resume": "press resume to continue",
    "wait": "resume once this has ended",
}
RESUMED_SHORT_LOSS = row("resumed:short_loss", ROUTINE, "a short loss has ended and the sticks were centred: they act again", said="info")

# Of the pilot: sticks, requests, who has control.
LOST_STICKS = row("lost:sticks", DANGER, "pilot lost: no sticks arrive from the ground station", said="warning")
LOST_ROS = row("lost:ros", DANGER, "pilot lost: no sticks arrive from ROS 2", said="warning")
SILENT_PAD = row("silent:pad", DANGER, "pilot lost: the pad is connected and does not answer", "unplug the pad and plug it in again", said="warning")
UNPLUGGED_PAD = row("unplugged:pad", DANGER, "pilot lost: the pad was unplugged", "plug it in again", said="warning")
CLOSED_KEYBOARD = row("closed:keyboard", DANGER, "pilot lost: the keyboard's window was closed", said="warning")
OUTDONE_LEASE = row("outdone:lease", DANGER, "another pilot has taken control", said="warning")
REFUSED = row("refused", PILOT, "the drone refuses a request", said="warning")
REFUSED_HERE = row("refused_here", PILOT, "a request was not sent", said="warning")
VOID_HOLD = row("void:hold", PILOT, "the button changed while it was held: nothing was done", "let go, and hold again", said="warning")
REFUSED_FAULT = row("refused:simulator/request", PILOT, "a simulated fault was refused")
REFUSED_INCIDENT = row("refused:incident", PILOT, "an incident of the script was refused", said="warning")
UNANSWERED = row("unanswered", PILOT, "the drone did not answer a request", said="warning")
UNANSWERED_INCIDENT = row("unanswered:incident", PILOT, "nobody answered an incident of the script", said="warning")
OVERTAKEN = row("overtaken", PILOT, "a disarm arrived after a later arm, and was not obeyed")
OVERRULED_REFERENCE = row("overruled:reference", DANGER, "the pilot's disarm was obeyed by control; reference had not heard it", said="info")
NOT_THE_HOLDER = row("not_the_holder", PILOT, "another ground station has the sticks")
NOT_THE_HOLDER_ROS = row("not_the_holder:ros", PILOT, "another node of ROS 2 has the sticks")
NOT_THE_HOLDER_PAGE = row("not_the_holder:page", PILOT, "the page does not have the sticks", said="warning")
EXPIRED_WISH = row("expired:wish", PILOT, "a request came too late from the page and was not done", said="warning")
LOST_PAGE_SILENT = row("lost:page_silent", DANGER, "pilot lost: nothing arrives from the pilot's page", said="warning")
LOST_PAGE_HIDDEN = row("lost:page_hidden", DANGER, "pilot lost: the pilot's page is hidden or its screen locked", "show the page again", said="warning")
LOST_PAGE_UNPLUGGED = row("lost:page_unplugged", DANGER, "pilot lost: the pad was unplugged from the browser", "plug it in again", said="warning")
LOST_PAGE_FROZEN = row("lost:page_frozen", DANGER, "pilot lost: the pad holds a stick and reports nothing", "move the stick, or plug the pad in again", said="warning")
LOST_PAGE_CLOSED = row("lost:page_closed", DANGER, "pilot lost: the pilot's page was closed", "open it again", said="warning")

# Of the link and the computers.
ALARM = row("alarm", DANGER, "an alarm was raised")
ALARM_LINK = row("alarm:link", DANGER, "the link got worse", said="warning")
ALARM_PEERS = row("alarm:peers", DANGER, "the two sides do not fit together; the drone will not arm", said="error")
ALARM_JUNK = row("alarm:junk", DANGER, "services receive many messages that they cannot read: a stranger sends on this network, or a sender is broken", said="warning")
MISTAKE = row("mistake", DANGER, "a mistake in Lindy itself: the screen may be wrong")
STALLED = row("stalled", DANGER, "a service handled nothing for over 0.14 s")
HUNG = row("hung", DANGER, "a service runs but does not answer", breaks="answered")
HUNG_RECORDER = row("hung:recorder", DATA, RECORDER_DOWN.sentence, breaks="answered")
MISSED_DEADLINE = row("missed_deadline", LIMIT, "a periodic step was skipped on a busy computer")
OUTAGE = row("outage", MESSAGE, "a message was lost because the link was down")
BURST = row("burst", MESSAGE, "the link lost a message in a burst of losses")
LOSS = row("loss", MESSAGE, "the link lost a message")
TRACE = row("trace", MESSAGE, "the link lost a message, as in the recorded trace")
QUEUE_FULL = row("queue_full", MESSAGE, "a message was dropped because the link's queue was full")
TOO_MANY = row("too_many", MESSAGE, "a message was dropped because too many were on the link")
NO_ROOM = row("no_room", MESSAGE, "a picture was dropped because the link had no room for it")
THINNED = row("thinned", MESSAGE, "a telemetry message was left out because the link is slow")
DAMAGED = row("damaged", MESSAGE, "the link damaged a message")
LOST = row("lost", MESSAGE, "a message never arrived: lost, or left out by a router that thins")
JUMPED_CLOCK = row("jumped:clock", MESSAGE, "a clock jumped")
IMPOSSIBLE_PONG = row("impossible:clock/pong", MESSAGE, "a reply to a clock ping was inconsistent and not used")

# Of messages that a service did not use.
EXPIRED = row("expired", MESSAGE, "a command arrived too late to be used")
DROPPED = row("dropped", MESSAGE, "a message was dropped")
REORDERED = row("reordered", MESSAGE, "a message arrived out of order and was not used")
DUPLICATED = row("duplicated", MESSAGE, "a message arrived twice")
MALFORMED = row("malformed", MESSAGE, "a message could not be read", breaks="understood")
WRONG_TYPE = row("wrong_type", MESSAGE, "a message was of the wrong type", breaks="understood")
WRONG_LENGTH = row("wrong_length", SENSOR, "a message had the wrong number of values", breaks="understood")
WRONG_LENGTH_ACTUATION = row("wrong_length:vehicle/actuation", SENSOR, "a thruster report had the wrong number of values", breaks="understood")
REPLAYED = row("replayed", MESSAGE, "a recorded message that was played again was refused")
WRONG_EPOCH = row("wrong_epoch", MESSAGE, "a command came from a pilot who is not in control")
UNKNOWN = row("unknown", MESSAGE, "a message arrived on an unknown key", breaks="understood")
MISNAMED = row("misnamed", MESSAGE, "a message was in the name of another service than its key", breaks="understood")
UNKNOWN_KEY = row("unknown_key", MESSAGE, UNKNOWN.sentence, breaks="understood")
TOO_MANY_KEYS = row("too_many_keys", MESSAGE, "a message arrived on more keys than are accepted", breaks="understood")
FROM_FUTURE = row("from_future", MESSAGE, "a message had a time stamp in the future", breaks="understood")
UNSYNCHRONISED = row("unsynchronised", MESSAGE, "a message arrived before the clocks were synchronised")
OVERFLOWED = row("overflowed", MESSAGE, "a service could not handle messages as fast as they arrived")
OVERSIZED = row("oversized", MESSAGE, "a message was too long to be kept")
MISCOUNTED = row("miscounted", MESSAGE, "a sender numbered its messages wrongly")
UNCOUNTED = row("uncounted", MESSAGE, "a service counts more kinds than a health message holds")
SKIPPED = row("skipped", MESSAGE, "a message was skipped for a newer one")
STALE = row("stale", SENSOR, "a stream was too old to be used")
STALE_COMMAND = row("stale:pilot/command", SENSOR, "the pilot's commands were too old to be used")
STALE_THRUSTERS = row("stale:control/thrusters", DANGER, "the thrusters stopped because no new command arrived")
SILENT = row("silent", SENSOR, "a stream did not arrive in time")

# Of the recording and the disk.
NOT_RECORDED = row("not_recorded", DATA, "a message was not recorded", breaks="recorded")
DISK_ERROR = row("disk_error", DATA, "writing to the disk failed", "free some of the disk", breaks="recorded")
UNREADABLE = row("unreadable", DATA, "a recorded message could not be read back", breaks="recorded")
MALFORMED_CHECKPOINT = row("malformed:memory", DATA, "a service's checkpoint could not be read")
NOT_REMEMBERED = row("not_remembered:disk", DATA, "a service's checkpoint could not be written to the disk")

# Of sensors and their estimates.
LOST_DEPTH = row("lost:depth", DANGER, "the depth is no longer known")
LOST_POSITION = row("lost:position", DANGER, "the position is no longer known")
LOST_ALTITUDE = row("lost:altitude", DANGER, "no altitude: holding depth", "choose altitude hold again once the bottom is measured", said="warning")
LOST_PLACE = row("lost:place", DANGER, "the drone can no longer hold its position; depth and heading are still held", said="warning")
UNUSABLE_IMU = row("unusable:sensor/imu", DANGER, IMU_LOST.sentence, said="warning")
UNUSABLE_PRESSURE = row("unusable:sensor/pressure", DANGER, "no pressure sample can be used: the depth is not measured", said="warning")
REGAINED = row("regained", SENSOR, "a sensor that was lost can be used again", said="info")
FROZEN = row("frozen", SENSOR, "a sensor keeps repeating the same value", said="info")
FROZEN_PRESSURE = row("frozen:sensor/pressure", DANGER, "the pressure sensor keeps repeating one value: the depth is not measured", said="warning")
UNHELD = row("unheld", DANGER, "an axis is not held because its estimate is not valid", said="warning")
UNHELD_DEPTH = row("unheld:depth", DANGER, DEPTH_LOST.sentence, "hold it by hand", said="warning")
UNHELD_HEADING = row("unheld:heading", DANGER, HEADING_LOST.sentence, "hold it by hand", said="warning")
INCONSISTENT_IMU = row("inconsistent:sensor/imu", DANGER, "the IMU does not fit the other sensors: its biases are estimated anew", said="warning")
FOUND_HEADING = row("found:heading", SENSOR, "the compass measures the heading again, which was unknown", said="info")
JUMPED_PRESSURE = row("jumped:sensor/pressure", DANGER, "the pressure jumped and stayed: the depth, and the held depth, moved with it", said="warning")
WAVES_PRESSURE = row("waves:sensor/pressure", ROUTINE, "there are waves: the depth sensor shows them, the depth does not", said="info")
RESTARTED = row("restarted", DANGER, "an estimator was restarted")
RESTARTED_DEPTH = row("restarted:depth", DANGER, "the estimate of the depth was restarted", said="warning")
LATE_PRESSURE = row("late:sensor/pressure", SENSOR, "pressure samples arrive late")
OUTLIER = row("outlier", SENSOR, "a measurement far from all others was rejected")
OUTLIER_ACTUATION = row("outlier:vehicle/actuation", SENSOR, "the measured acceleration does not fit thrust and drag")
SATURATED_IMU = row("saturated:sensor/imu", SENSOR, "the IMU is at the end of its range")
WRONG_FORCE_IMU = row("wrong_force:sensor/imu", DANGER, "the IMU's specific force at rest is not that of gravity", said="warning")
UPSIDE_DOWN_IMU = row("upside_down:sensor/imu", DANGER, "the IMU reads as if the drone lay upside down", said="warning")
ON_ITS_SIDE_IMU = row("on_its_side:sensor/imu", DANGER, "the IMU reads as if the drone lay on its side or end", said="warning")
MOVING_CALIBRATION = row("moving:calibration", DANGER, "the drone does not come to rest, or its gyroscope is not in rad/s", said="warning")
ROUGH_CALIBRATION = row("rough:calibration", DANGER, "the drone has not rested since the start: its gyroscope and the air's pressure are known roughly, depth may be wrong by 0.3 m and the heading drifts, until it rests with its thrusters off", said="warning")
MOVED = row("moved", SENSOR, "the drone moves: calibration waits until it is still", said="warning")
WAITING = row("waiting", SENSOR, "calibration waits for a sensor", said="warning")
IMPLAUSIBLE = row("implausible", SENSOR, "an implausible measurement was rejected")
IMPLAUSIBLE_ATMOSPHERE = row("implausible:atmosphere", SENSOR, "the pressure measured at the start is not the air above a floating drone: the standard atmosphere is used, the depth may be wrong by 0.3 m", said="warning")
ASSUMED_ATMOSPHERE = row("assumed:atmosphere", DANGER, "the thrusters ran during calibration, so the drone may not have floated: the standard atmosphere is used, the depth may be wrong by 0.3 m", said="warning")
WRONG_UNIT = row("wrong_unit", DANGER, "the values of a sensor do not fit its unit", said="warning")
OLD_STAMPS = row("old_stamps", DANGER, "samples of a sensor are too old when they arrive", said="warning")
SILENT_BY_FAULT = row("silent_by_fault", SENSOR, "a simulated fault silenced a sensor")
NOISY = row("noisy", SENSOR, "a sensor is very noisy: it has less weight")
GAP = row("gap", SENSOR, "samples of a sensor or of the state are missing")
RATE = row("rate", SENSOR, "a sensor samples at the wrong rate")
DISTURBED = row("disturbed", SENSOR, "the compass is disturbed and not used", "`lindy calibrate compass` learns the iron and magnets of the drone; the heading from the gyroscope goes on")
STEEP = row("steep", SENSOR, "the magnetic field is too steep for the compass")
LEARNT = row("learnt", SENSOR, "the compass takes a field that has not changed for long as its normal one")
NO_BOTTOM = row("no_bottom", SENSOR, "the Doppler log (DVL) has no bottom lock")
NO_BOTTOM_ALTIMETER = row("no_bottom:sensor/altitude", SENSOR, "the echo sounder hears no bottom", said="info")
TOO_OLD = row("too_old", SENSOR, "a measurement came too late to be used")
UNREADY = row("unready", ROUTINE, "a measurement is not used yet: calibrating")
AHEAD = row("ahead", SENSOR, "a measurement had a time stamp in the future")
NOT_NEWER = row("not_newer", SENSOR, "a sample was not newer than the previous one")
PREDICTED = row("predicted", DANGER, "the drone's state is predicted because its IMU is silent")
NOT_FINITE = row("not_finite", DANGER, "a calculation gave no finite number and was restarted")
RESTING = row("resting", ROUTINE, "the gyroscope was calibrated at rest")

# Of instruments on board: a DVL, an echo sounder, a receiver of GNSS, an acoustic position.
SILENT_INSTRUMENT = row("silent_instrument", SENSOR, "an instrument on board does not answer", "check its power, cable and url", said="warning")
ANSWERING = row("answering", ROUTINE, "an instrument on board answers", said="info")
TROUBLE = row("trouble", SENSOR, "an instrument on board reports trouble of its own", said="warning")
CONFIGURED = row("configured", ROUTINE, "an instrument on board was set up", said="info")
NOT_CONFIGURED = row("not_configured", SENSOR, "an instrument on board refuses a setting or command", said="warning")
SECOND_INSTRUMENT = row("second_instrument", SENSOR, "two instruments on board measure the same: only the first is used", "leave one of them out of the stack", said="warning")
SECOND_POSITION = row("second_position", ROUTINE, "two instruments on board know the position: the first is used, the other one when it is silent", said="info")
NONSENSE = row("nonsense", SENSOR, "what an instrument on board measures cannot be", "look at its own page", said="warning")
NO_FIX = row("no_fix", SENSOR, "an instrument on board has no position", said="info")
ORIGIN = row("origin", ROUTINE, "north and east count from here", said="info")

# Of control, thrusters and battery.
_CANNOT = "the drone cannot follow: the wanted"
INVALID = row("invalid", DANGER, "control goes on without a valid estimate")
INVALID_POSITION = row("invalid:state.position", DANGER, "the position is held without a valid estimate of it")
LATE = row("late", LIMIT, "an axis is controlled with a late estimate and lower gains")
CLAMPED = row("clamped", LIMIT, "a value was limited")
CLAMPED_DEPTH = row("clamped:reference.depth", LIMIT, f"{_CANNOT} depth waits for it", said="warning")
CLAMPED_HEADING = row("clamped:reference.heading", LIMIT, f"{_CANNOT} heading waits for it", said="warning")
CLAMPED_PLACE = row("clamped:reference.place", LIMIT, f"{_CANNOT} position waits for it", said="warning")
CLAMPED_HORIZONTAL = row("clamped:reference.horizontal", LIMIT, "the drone tilts too far: less surge and sway than asked for", said="warning")
SATURATED = row("saturated", LIMIT, "a thruster reached its limit")
LAW_REFUSED = row("law_refused", DANGER, "a plan of the user's reference law cannot be flown, and Lindy's own flies in its place", "look at the law, or take it out of the stack file", said="warning")
UNDRIVEN = row("undriven", LIMIT, "a motion was asked for that the thrusters cannot produce")
DISARMED = row("disarmed", LIMIT, "thrust was asked for while the drone is disarmed")
EMPTY = row("empty", DANGER, "the battery is empty")
LEAK_FOUND = row("leak", DANGER, "water was found inside the vehicle")

# Of the vehicle's board.
OUTDONE_ARDUSUB = row("outdone:ardusub", DANGER, "somebody else has the vehicle", "disarm and arm to take it back", said="warning")
STRANGER = row("stranger", MESSAGE, "a packet of another sender than the board or the instrument was not used")
STRANGER_SYSTEM = row("stranger:system", DANGER, "somebody else speaks to the board in Lindy's name", "give one of the two another system (ardusub.system and the board's parameter)", said="warning")
REFUSED_BOARD = row("refused:board", DANGER, "the board is not armed", "change what is named, at the board", said="error")
REFUSED_ARM = row("refused:board_arm", DANGER, "the vehicle's board refuses to arm", said="error")
SILENT_BOARD = row("silent:board", DANGER, "the vehicle's board has been silent for a second", "check its power, its cable and ardusub.url", said="error")
JUMPED_BOARD_CLOCK = row("jumped:board_clock", DANGER, "the clock of the vehicle's board jumped", "disarm and arm to go on", said="error")
NOT_GIVEN = row("not_given", DANGER, "the board does not send a message that it was asked for", said="error")
REFUSED_SERVO = row("refused:servo", PILOT, "the board refuses to move an output", "choose a free output of the board in the vehicle file", said="warning")
UNANSWERED_SERVO = row("unanswered:servo", PILOT, "the board does not answer for an output; it is asked again", said="warning")
SLOW = row("slow", SENSOR, "a message of the board comes more rarely than it was asked for", said="warning")
SHIFTED_BOARD_CLOCK = row("shifted:board_clock", MESSAGE, "the clock of the vehicle's board shifted by less than a second")

# Of ground stations on MAVLink.
REFUSED_COMMAND = row("refused:command", PILOT, "a command of a ground station was refused")
REFUSED_PARAMETER = row("refused:parameter", PILOT, "a parameter was not changed for a ground station")
TOO_MANY_MAVLINK = row("too_many:mavlink", PILOT, "there are too many ground stations at once")
DROPPED_MAVLINK = row("dropped:mavlink", MESSAGE, "the other end of a MAVLink link does not read what it is sent")
WRONG_TARGET = row("wrong_target", MESSAGE, "a message was for another vehicle")
IGNORED = row("ignored", MESSAGE, "a message asked for what there is not")
UNKNOWN_PARAMETER = row("unknown_parameter", MESSAGE, "a parameter was asked for that there is not")
DOES_NOT_FIT = row("does_not_fit", MESSAGE, "a number did not fit into a message and was not sent")

# Of the cockpit's page.
REFUSED_WATCHER = row("refused:watcher", PILOT, "a page that only watches tried to command")
REFUSED_PAGE = row("refused:page", MESSAGE, "a foreign page or program was refused")
MALFORMED_PAGE = row("malformed:page", MESSAGE, "a page sent what could not be read", breaks="understood")
OVERSIZED_PAGE = row("oversized:page", MESSAGE, "a page sent a message that was too long")
WRONG_VERSION_PAGE = row("wrong_version:page", MESSAGE, "a page of another version was refused")
DROPPED_PAGE = row("dropped:page", ROUTINE, "a page was too slow and missed a picture of the drone")
DROPPED_PAGE_VIDEO = row("dropped:page_video", ROUTINE, "a page was too slow and missed a camera's picture")
BROKEN_PAGE_VIDEO = row("broken:page_video", MESSAGE, "a camera's picture was lost: pages had none until the next keyframe")
TOO_MANY_PAGES = row("too_many:page", PILOT, "there are too many pages of the cockpit")
TOO_MANY_PAGE_MESSAGES = row("too_many:page_messages", PILOT, "a page sent too many messages and was closed")
TOO_MANY_CONNECTIONS = row("too_many:connection", PILOT, "there are too many connections to the cockpit")

# Of the camera and the viewer.
LOST_CAMERA = row("lost:camera", DANGER, "the camera gives no pictures")
STALE_PICTURE = row("stale:picture", MESSAGE, "a picture was too old to be sent")
DROPPED_PICTURE = row("dropped:picture", MESSAGE, "a picture did not arrive whole and was dropped")
UNENCODED_PICTURE = row("unencoded:picture", MESSAGE, "the encoder gave nothing, or too much, for a picture")
SKIPPED_PICTURE = row("skipped:picture", MESSAGE, "a picture was skipped for a newer one")
LEFT_OUT_PICTURE = row("left_out:picture", ROUTINE, "a picture was left out to keep to the link's room")
UNDECODABLE = row("undecodable", MESSAGE, "a picture could not be decoded")
LOST_LIVE_VIEWER = row("lost:live_viewer", MESSAGE, "the live viewer was lost")
DROPPED_LIVE = row("dropped:live", MESSAGE, "the live viewer missed messages because it was too slow")
# fmt: on
