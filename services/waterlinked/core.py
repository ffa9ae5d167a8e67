"""The driver of a DVL A50 or A125 as a pure state machine: what it says becomes samples; set-up.

Lines of JSON, one for each object, as Water Linked's page "DVL protocol" has them (docs/dvl/
dvl-protocol.md in github.com/waterlinked/waterlinked.github.io, protocol 2.3, json_v3). Older
firmware sends json_v1 and v2, without covariance and times, v1 without `type`.
"""

from collections.abc import Iterable, Sequence
from math import isfinite, sqrt
from typing import Annotated, Any

import msgspec

from messages import events, topics
from messages.events import Outbox
from messages.payload import UNDECODABLE
from messages.sensors import DvlSample
from messages.units import Finite, Ns, Vec3
from services.instruments.core import InstrumentWatch, LineCutter
from services.marine.mounting import ALONG, Rotation

KNOWN = ("json_v1", "json_v2", "json_v3", "json_v3.1")
LONGEST = 16_384  # [bytes] of a line; a report has about 1,200
LEAST_STD = 0.001  # [m/s] what its maker promises at best; a figure of merit may be far below
LONGEST_AGE = 1.0  # [s] from the echo to the report; beyond, its clock is not believed


class DvlReport(msgspec.Struct, frozen=True):
    """One line, whichever kind it is."""

    type: str = "velocity"
    format: str = ""
    # Of a velocity.
    vx: Finite | None = None  # [m/s] forward, of the instrument
    vy: Finite | None = None  # [m/s] starboard
    vz: Finite | None = None  # [m/s] down
    fom: Finite | None = None  # [m/s]
    covariance: list[list[float]] | None = None  # [m²/s²]
    altitude: Finite | None = None  # [m] negative: none
    velocity_valid: bool | None = None
    status: int = 0  # 0: no trouble; 1: too hot
    time_of_validity: int | None = None  # [µs] of its own clock: middle of the echo
    time_of_transmission: int | None = None  # [µs] the same: before the report was sent
    # Of an answer.
    response_to: str = ""
    success: bool = False
    error_message: str = ""
    result: dict[str, Any] | None = None

    @property
    def velocity(self) -> Vec3 | None:
        """[m/s] None: it has no lock on the bottom."""
        if self.vx is None or self.vy is None or self.vz is None or not self.velocity_valid:
            return None
        return self.vx, self.vy, self.vz

    @property
    def is_whole(self) -> bool:
        """Does a velocity report say what each firmware says?"""
        return None not in (self.vx, self.vy, self.vz, self.velocity_valid)

    @property
    def std(self) -> float:
        """[m/s] The largest of what the covariance says of the horizontal components, of the figure
        of merit, and of the least that its maker promises. A covariance of zeros says nothing."""
        return max(LEAST_STD, abs(self.fom or 0.0), _horizontal(self.covariance or []))

    @property
    def age(self) -> float | None:
        """[s] From the echo to the report, by its own clock; None: it does not say, or nothing that
        can be."""
        if not self.time_of_validity or not self.time_of_transmission:
            return None
        age = (self.time_of_transmission - self.time_of_validity) / 1e6
        return age if 0.0 <= age <= LONGEST_AGE else None


def _horizontal(covariance: list[list[float]]) -> float:
    if len(covariance) != 3 or any(len(row) != 3 for row in covariance):
        return 0.0
    largest = max(covariance[0][0], covariance[1][1])
    return sqrt(largest) if isfinite(largest) and largest > 0.0 else 0.0


_DECODER = msgspec.json.Decoder(DvlReport)


def read(line: bytes) -> DvlReport | None:
    """None for what is no report: no JSON, a NaN, another shape."""
    try:
        return _DECODER.decode(line)
    except UNDECODABLE:
        return None


def command(name: str, **parameters: object) -> bytes:
    asked: dict[str, object] = {"command": name}
    return msgspec.json.encode(asked | ({"parameters": parameters} if parameters else {})) + b"\n"


S = 1_000_000_000  # [ns]
FASTEST = 15.0  # [m/s] of any component; no vehicle with a DVL comes near it
ASK_NS, ASKED_MOST = 2 * S, 5  # [ns] between two questions for its configuration; some never answer
OFFSET = "mounting_rotation_offset"


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [waterlinked] of a vehicle file."""

    # tcp:HOST:PORT, as its own page shows it; empty: there is none.
    url: Annotated[str, msgspec.Meta(max_length=200)] = ""
    # [m/s] set at the start; None: as it is set up.
    sound_speed: Annotated[float, msgspec.Meta(ge=1000.0, le=2000.0)] | None = None
    # [s] from the echo to the arrival of a report without times, as of older firmware.
    latency: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.15
    calibrate_on_start: bool = False  # of its gyroscope: the vehicle must be at rest


class DvlDriver:
    """Bytes in; samples, requests and events out.

    A sample's stamp is its arrival less its age, by the instrument's own two times: nobody has to
    set its clock. Reports that arrive together were sent one after the other, and are dated back
    from the newest of them.
    """

    def __init__(self, settings: Settings, outbox: Outbox, mounted: Rotation = ALONG) -> None:
        """`mounted`: the rotation in the vehicle file; where there is one, the instrument must not
        turn its axes as well."""
        self.watch = InstrumentWatch("dvl", outbox)
        self._settings, self._outbox, self._turned = settings, outbox, mounted != ALONG
        self._cutter = LineCutter(LONGEST)
        self._to_send = [command("calibrate_gyro")] if settings.calibrate_on_start else []
        self.config: dict[str, Any] | None = None  # newest that it told
        self._asked, self._ask_ns = 0, 0
        self._status, self._format = 0, ""
        self._stamp_ns: Ns | None = None  # of the newest sample
        self.told = ""

    def heard(self, pieces: Iterable[bytes], arrival: Ns) -> Sequence[DvlSample]:
        """Samples in what has arrived, with all that the answers ask for kept for `due`."""
        lines, too_long = self._cutter.lines(pieces)
        reports = [self._read(line, arrival) for line in lines]
        self.watch.garbled(too_long + reports.count(None))
        found = [report for report in reports if report is not None and report.type == "velocity"]
        sent = [each.time_of_transmission for each in found if each.age is not None]
        samples = [self._sample(each, arrival, sent[-1] if sent else None) for each in found]
        return [sample for sample in samples if sample is not None]

    def due(self, now: Ns) -> Sequence[bytes]:
        """Its configuration is asked for whenever it is there anew; the rest is sent once."""
        if not self.watch.answers:
            return []
        sent, self._to_send = [] if self.watch.only_asks else self._to_send, []
        if self.config is None and self._asked < ASKED_MOST and now >= self._ask_ns:
            self._asked, self._ask_ns = self._asked + 1, now + ASK_NS
            sent.append(command("get_config"))
        return sent

    # What it says.

    def _read(self, line: bytes, arrival: Ns) -> DvlReport | None:
        report = read(line)
        if report is None or (report.type == "velocity" and not report.is_whole):
            return None
        if report.type == "response":
            self._answered(report)
        elif report.type == "velocity":
            if self.watch.reported(arrival):
                self.config, self._asked = None, 0
            self._look_at(report)
        return report

    def _look_at(self, report: DvlReport) -> None:
        """What people should know of it, once."""
        if report.status and report.status != self._status:
            hot = ", it is too hot" if report.status == 1 else ""
            self._outbox.tell(events.TROUBLE("dvl", detail=f"status {report.status}{hot}"))
        if report.format != self._format and report.format not in KNOWN:
            text = f"the DVL speaks {report.format[:40]!r}, known are {KNOWN[0]} to {KNOWN[-1]}"
            self._outbox.say("info", text)
        self._status, self._format = report.status, report.format
        high = max(0.0, report.altitude or 0.0)
        lock = "no bottom lock" if report.velocity is None else f"{high:.2f} m high"
        self.told = f"{report.format or 'json_v1'}, {lock}"

    def _sample(self, report: DvlReport, arrival: Ns, newest: int | None) -> DvlSample | None:
        wrong = dict[str, str]()  # what cannot be, in words
        age, velocity, altitude = report.age, report.velocity, report.altitude
        if age is None and report.time_of_validity:
            wrong["time_of_validity"] = "its two times do not belong together"
        if altitude is not None and altitude < 0.0:
            if velocity is not None:  # without lock it is how a DVL says that it has none
                wrong["altitude"] = f"an altitude of {altitude:g} m"
            altitude = None
        if velocity is not None and max(map(abs, velocity)) > FASTEST:
            wrong["velocity"] = f"{max(velocity, key=abs):g} m/s"
        for what, why in wrong.items():
            self._outbox.tell(events.IMPLAUSIBLE(what))
            self.watch.measured_nothing(arrival, events.NONSENSE("dvl", detail=why))
        if not wrong:
            self.watch.measured()

        if age is not None and newest is not None and report.time_of_transmission is not None:
            waited = (newest - report.time_of_transmission) / 1e6  # [s] behind others
            age += waited if 0.0 <= waited <= 1.0 else 0.0
        stamp = arrival - round((self._settings.latency if age is None else age) * S)
        if self._stamp_ns is not None and stamp <= self._stamp_ns:
            self._outbox.tell(events.NOT_NEWER(topics.DVL.key))
            return None
        self._stamp_ns = stamp
        if "velocity" in wrong:
            return None
        return DvlSample(stamp_ns=stamp, velocity=velocity, std=report.std, altitude=altitude)

    # How it is set up.

    def _answered(self, answer: DvlReport) -> None:
        name = answer.response_to
        if not answer.success:
            why = f"{name[:40]}: {answer.error_message[:200]}"
            self._outbox.tell(events.NOT_CONFIGURED("dvl", detail=why))
        elif name == "get_config" and answer.result is not None:
            self.config = answer.result
            self._set_up(answer.result)
        elif name != "get_config":
            self._outbox.tell(events.CONFIGURED("dvl", detail=f"{name[:40]} done"))

    def _set_up(self, config: dict[str, Any]) -> None:
        wanted: dict[str, object] = {"acoustic_enabled": True}
        if self._settings.sound_speed is not None:
            wanted["speed_of_sound"] = self._settings.sound_speed
        if self._turned:
            wanted[OFFSET] = 0
        wrong = {k: value for k, value in wanted.items() if k in config and config[k] != value}
        if wrong:
            self._to_send.append(command("set_config", **wrong))
            changes = ", ".join(f"{k} from {config[k]!r} to {wrong[k]!r}" for k in wrong)
            self._outbox.say("info", f"the DVL is set up anew: {changes}"[:400])
        if not self._turned and config.get(OFFSET):
            text = f"the DVL turns its axes by {config[OFFSET]!r}° itself ({OFFSET})"
            self._outbox.say("info", text[:200])
