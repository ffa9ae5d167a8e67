"""A board is checked before it is listened to: heartbeat, version, parameters, clock.

Only one that passed all of them is listened to and may be armed. A refused one is introduced again
after a while: what is wrong may have been put right. None of its parameters is ever made less safe:
FS_PILOT_TIMEOUT alone is written, and only where the settings say so."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal, NamedTuple

from messages import events
from messages.units import Ns
from services.ardusub.commands import servos_of
from services.ardusub.mixing import FRAMES, NEUTRAL, Mixer, RcChannel, senses
from services.ardusub.settings import DriverOutbox, Settings
from services.ardusub.telemetry import BoardClock
from services.marine.outputs import LIGHT
from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import (
    ARDUPILOT,
    AUTOPILOT,
    MESSAGE_IDS,
    SUBMARINE,
    MavCommand,
    MavlinkPacket,
    command,
)

Values = Mapping[str, float]
RENAMED = (4, 7)  # first version with the names of 4.8
OLDEST = (4, 5)
YAW_SCALE = 3.375  # ACRO_YAW_P that leaves manual yaw as it is
AGAIN_NS = 200_000_000  # [ns] between two rounds of requests
BATCH = 16  # parameters asked for in a round: the board may drop more at once
TRIES = 25  # rounds
OPTIONAL_TRIES = 5  # rounds, for a parameter that this version may not have
THROTTLE = 3  # override channel
EXACT = 1e-3  # [-] values travel as 32-bit floats
RECOMMENDED_S = 1.0  # [s] of FS_PILOT_TIMEOUT
DISARM = 2  # what a failsafe of the board does
MOTORS = (*range(33, 41), *range(82, 86))  # SERVOn_FUNCTION of motors 1 to 12
# Judged where the board has them, by `advice`.
ADVISED = ("BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT", "FS_EKF_ACTION", "FS_CRASH_CHECK")
# Which channel moves which axis: newer than 4.5, where it is fixed.
CHANNELS = {
    f"RCMAP_{axis}": channel
    for channel, axis in enumerate(("PITCH", "ROLL", "THROTTLE", "YAW", "FORWARD", "LATERAL"), 1)
}
# What arming checks are done: the name in 4.7 and newer, and in 4.5 and builds on the way to 4.7.
ARMING = ("ARMING_SKIPCHK", "ARMING_CHECK")


class ParameterRule(NamedTuple):
    """What a parameter may be: within a range, and one of a few values where these are given."""

    name: str
    allowed: str
    least: float = -inf
    most: float = inf
    one_of: tuple[float, ...] = ()
    never: float | None = None
    optional: bool = False  # judged where the board has it

    def holds(self, value: float) -> bool:
        listed = not self.one_of or value in self.one_of
        return self.least <= value <= self.most and listed and value != self.never


def is_new(version: tuple[int, int]) -> bool:
    return version >= RENAMED


def names(version: tuple[int, int], motors: int) -> list[str]:
    """All parameters that are read, under the names of this version."""
    ruled = (rule.name for rule in rules(version, motors) if not rule.optional)
    system = "MAV_GCS_SYSID" if is_new(version) else "SYSID_MYGCS"
    more = "FRAME_CONFIG", "MOT_FV_CPLNG_K", f"RC{THROTTLE}_TRIM", system
    return list(dict.fromkeys([*ruled, *more]))


def optional(version: tuple[int, int]) -> tuple[str, ...]:
    """Names of those that are judged where this version has them."""
    ruled = (rule.name for rule in rules(version, 0) if rule.optional)
    return (*ruled, "MAV_GCS_SYSID_HI") if is_new(version) else tuple(ruled)


def rules(
    version: tuple[int, int], motors: int, most_timeout: float | None = None
) -> list[ParameterRule]:
    """For all but FRAME_CONFIG and the system ids, which need more than one value.

    Args:
        most_timeout: [s] of FS_PILOT_TIMEOUT, by the settings.
    """
    axes, motor_numbers = range(1, 7), range(1, motors + 1)
    new = is_new(version)
    found = [
        ParameterRule("FS_PILOT_INPUT", "2 (disarm when the sticks are silent)", one_of=(2,)),
        ParameterRule("FS_PILOT_TIMEOUT", "0.1 to 3 s", 0.1, 3.0),
        ParameterRule(
            "FS_GCS_ENABLE", "2, 3 or 4 (act without a ground station)", one_of=(2, 3, 4)
        ),
        ParameterRule("FS_LEAK_ENABLE", "1 or 2 (warn or surface)", one_of=(1, 2)),
        ParameterRule("RC_OVERRIDE_TIME", "0.1 to 10 s (0 disables overrides)", 0.1, 10.0),
        ParameterRule("ACRO_YAW_P", "0.5 to 10", 0.5, 10.0),
        *[ParameterRule(f"MOT_{n}_DIRECTION", "1 or -1", one_of=(1, -1)) for n in motor_numbers],
        *[ParameterRule(f"RC{n}_MIN", "1000 to 1300 µs", 1000, 1300) for n in axes],
        *[ParameterRule(f"RC{n}_MAX", "1700 to 2000 µs", 1700, 2000) for n in axes],
        *[ParameterRule(f"RC{n}_REVERSED", "0 or 1", one_of=(0, 1)) for n in axes],
        *[ParameterRule(f"RC{n}_TRIM", "1500 µs", NEUTRAL, NEUTRAL) for n in axes if n != THROTTLE],
        ParameterRule("MOT_BAT_CURR_MAX", "0 (no limit of the motors)", one_of=(0,)),
        *[
            ParameterRule(
                name, f"{channel}, its override channel", one_of=(channel,), optional=True
            )
            for name, channel in CHANNELS.items()
            if version > OLDEST
        ],
    ]
    if new:
        skipped = "not -1 (all checks skipped)"
        found.append(ParameterRule("ARMING_SKIPCHK", skipped, never=-1, optional=True))
        found.append(ParameterRule(f"RC{THROTTLE}_TRIM", "1500 µs", NEUTRAL, NEUTRAL))
    found.append(ParameterRule("ARMING_CHECK", "not 0 (no checks)", never=0, optional=new))
    if most_timeout is not None:
        allowed = f"at most {most_timeout:g} s (ardusub.set_pilot_timeout)"
        found.append(ParameterRule("FS_PILOT_TIMEOUT", allowed, most=most_timeout + EXACT))
    return found


def problems(
    values: Values, version: tuple[int, int], settings: Settings, vehicle: Vehicle
) -> list[str]:
    """Why the board must not be armed, one sentence each: parameter, found, allowed.

    Args:
        values: of all `names`, and of those `optional` that the board has.
    """
    found = [
        f"{rule.name} is {values[rule.name]:g}; allowed: {rule.allowed}"
        for rule in rules(version, len(vehicle.thruster), settings.set_pilot_timeout)
        if rule.name in values and not rule.holds(values[rule.name])
    ]
    if not any(name in values for name in ARMING):
        found.append(f"{' and '.join(ARMING)} are not answered; allowed: one of them")
    found += _wrong_throttle(values, version)
    found += _wrong_system(values, version, settings)
    # A board may say anything, infinity too.
    frame = next((f for number, f in FRAMES.items() if number == values["FRAME_CONFIG"]), None)
    if frame is None:
        return [*found, f"FRAME_CONFIG is {values['FRAME_CONFIG']:g}; allowed: 0 to 7"]
    try:
        senses(frame, vehicle.thruster)
    except ValueError as error:
        found.append(
            f"FRAME_CONFIG is {values['FRAME_CONFIG']:g}; allowed: the frame of {vehicle.name}, "
            f"because {error}"
        )
    return found


def moved_motors(values: Values, servos: Mapping[str, int]) -> list[str]:
    """Outputs of the vehicle file that would move a motor of the board, one sentence each.

    Args:
        servos: number of the servo output of each output.
    """
    functions = {name: values.get(f"SERVO{n}_FUNCTION") for name, n in servos.items()}
    return [
        f"SERVO{servos[name]}_FUNCTION is {function:g}, a motor, and output {name} of the vehicle "
        f"file has this servo; allowed: an output that is free"
        for name, function in functions.items()
        if function is not None and function in MOTORS
    ]


def advice(values: Values) -> list[str]:
    """What the parameters may be, but had better not be, one sentence each: parameter, found, what
    follows, recommended."""
    found = list[str]()
    if (timeout := values["FS_PILOT_TIMEOUT"]) > RECOMMENDED_S + EXACT:
        found.append(
            f"FS_PILOT_TIMEOUT is {timeout:g} s: if this computer dies the motors go on for so "
            f"long; recommended: at most {RECOMMENDED_S:g} s"
        )
    for name in ("BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"):
        if values.get(name) == DISARM:
            found.append(
                f"{name} is 2: the board stops all motors when its battery runs low, at whatever "
                f"depth; recommended: 3 (surface) or 0 (Lindy's own failsafe rises)"
            )
    for name, judge in (("FS_EKF_ACTION", "own estimator, which Lindy does not use,"),
                        ("FS_CRASH_CHECK", "crash check")):  # fmt: skip
        if values.get(name) == DISARM:
            found.append(
                f"{name} is 2: the board's {judge} may disarm it in mid-dive; recommended: 0 or 1"
            )
    return found


def mixer_of(values: Values, vehicle: Vehicle) -> Mixer:
    """For a board without `problems`."""
    channels = [
        RcChannel(
            values[f"RC{n}_MIN"], values[f"RC{n}_TRIM"], values[f"RC{n}_MAX"],
            bool(values[f"RC{n}_REVERSED"]),
        )
        for n in range(1, 7)
    ]  # fmt: skip
    return Mixer(
        FRAMES[int(values["FRAME_CONFIG"])],
        vehicle.thruster,
        channels,
        values["ACRO_YAW_P"] / YAW_SCALE,
        values["MOT_FV_CPLNG_K"],
    )


def _wrong_throttle(values: Values, version: tuple[int, int]) -> list[str]:
    """With which 1500 µs is not zero."""
    if is_new(version):
        return []
    least, trim, most = (values[f"RC3_{part}"] for part in ("MIN", "TRIM", "MAX"))
    if trim != least:
        return [f"RC3_TRIM is {trim:g}; allowed: RC3_MIN, {least:g} µs, in this version"]
    if (least + most) / 2 != NEUTRAL:
        return [f"RC3_MAX is {most:g}; allowed: {2 * NEUTRAL - least:g} µs, so that 1500 is zero"]
    return []


def _wrong_system(values: Values, version: tuple[int, int], settings: Settings) -> list[str]:
    name = "MAV_GCS_SYSID" if is_new(version) else "SYSID_MYGCS"
    least = values[name]
    most = max(least, values.get("MAV_GCS_SYSID_HI", 0.0))
    if least <= settings.system <= most:
        return []
    return [f"{name} is {least:g}; allowed: {settings.system}, the system of ardusub.system"]


@dataclass(slots=True)
class ParameterReader:
    """Asks for parameters by name until each was answered, and sets one if it must."""

    board: int  # system
    wanted: list[str]
    optional: tuple[str, ...] = ()  # asked for as well, and done without where it is not answered
    values: dict[str, float] = field(default_factory=dict[str, float])
    to_set: dict[str, float] = field(default_factory=dict[str, float])
    _tries: int = 0
    _optional_tries: int = 0  # of them, since all that is wanted was answered
    _asked: Ns | None = None

    @property
    def complete(self) -> bool:
        if self.to_set or not self._has_wanted:
            return False
        tried = self._optional_tries > OPTIONAL_TRIES
        return tried or not self._missing(self.optional)

    @property
    def _has_wanted(self) -> bool:
        return not self._missing(self.wanted)

    def _missing(self, names: Sequence[str]) -> list[str]:
        """What is still to be answered; of the two names of ARMING one will do."""
        known = {*self.values, *(ARMING if any(name in self.values for name in ARMING) else ())}
        return [name for name in names if name not in known]

    @property
    def given_up(self) -> list[str]:
        """What was asked for often enough and never answered, or never set."""
        if self._tries <= TRIES:
            return []
        return [*self.to_set, *self._missing(self.wanted)]

    def heard(self, name: str, value: float) -> None:
        if name in self.wanted or name in self.optional:
            self.values[name] = value
        if name in self.to_set and abs(value - self.to_set[name]) < EXACT:
            del self.to_set[name]

    def lower(self, name: str, most: float) -> None:
        """Set a parameter that was read to `most` if it is more."""
        if name not in self.to_set and self.values.get(name, most) > most + EXACT:
            self.to_set[name], self._tries, self._asked = most, 0, None

    def due(self, now: Ns) -> list[MavlinkPacket]:
        if self.complete or self.given_up:
            return []
        if self._asked is not None and now - self._asked < AGAIN_NS:
            return []
        self._asked, self._tries = now, self._tries + 1
        self._optional_tries += self._has_wanted
        target = {"target_system": self.board, "target_component": AUTOPILOT}
        asked = self._missing((*self.wanted, *self.optional))[:BATCH]
        return [
            MavlinkPacket("PARAM_REQUEST_READ", {**target, "param_id": name, "param_index": -1})
            for name in asked
        ] + [
            MavlinkPacket(
                "PARAM_SET", {**target, "param_id": name, "param_value": value, "param_type": 9}
            )
            for name, value in self.to_set.items()
        ]


S = 1_000_000_000  # [ns]
ASK_NS = S // 2  # [ns] before the version is asked for again
REFUSED_NS = 5 * S  # [ns] before a refused board is checked again
Stage = Literal["silent", "version", "parameters", "clock", "accepted", "refused"]


class BoardIntroduction:
    def __init__(
        self,
        vehicle: Vehicle,
        settings: Settings,
        clock: BoardClock,
        outbox: DriverOutbox,
        end: Callable[[], None],
    ) -> None:
        """
        Args:
            end: called before a board is refused, for it may be armed.
        """
        self._vehicle, self._settings, self._clock = vehicle, settings, clock
        self._servos = servos_of(vehicle.output)
        self._outbox, self._end = outbox, end
        self._now: Ns = 0
        self._again_ns: Ns = 0  # a refused board is checked
        self.forget()

    def forget(self) -> None:
        self.stage: Stage = "silent"
        self.version: tuple[int, int] = (0, 0)
        self.mixer: Mixer | None = None
        self.accepted_ns: Ns | None = None
        self._asked_ns: Ns | None = None  # for the version
        self._reader = ParameterReader(self._settings.board, [])

    def may_begin_again(self, now: Ns) -> bool:
        """Has it been refused for long enough?"""
        self._now = now
        return self.stage == "refused" and now >= self._again_ns

    def ask(self, now: Ns) -> None:
        """Send what is due now."""
        if self.stage == "version" and (self._asked_ns is None or now - self._asked_ns >= ASK_NS):
            self._asked_ns = now
            wanted = MESSAGE_IDS["AUTOPILOT_VERSION"]
            self._outbox.send(command(self._settings.board, MavCommand.REQUEST_MESSAGE, wanted))
        if self.stage == "parameters":
            self._outbox.packets += self._reader.due(now)
            if self._reader.complete:  # without those that are optional
                self._check()
            for name in self._reader.given_up:
                what = "could not be set" if name in self._reader.to_set else "is not answered"
                self.refuse(f"{name} {what}")

    def refuse(self, why: str) -> None:
        self._end()
        self.stage = "refused"
        self._again_ns = self._now + REFUSED_NS
        self._outbox.tell(events.REFUSED_BOARD(detail=why))

    # What the board says.

    def heard_heartbeat(self, fields: dict[str, Any]) -> None:
        kind, autopilot = fields["type"], fields["autopilot"]
        if autopilot != ARDUPILOT:
            self.refuse(f"its autopilot is {autopilot}; allowed: 3 (ArduPilot)")
        elif kind != SUBMARINE:
            self.refuse(f"it flies a vehicle of type {kind}; allowed: 12 (submarine)")
        elif self.stage == "silent":
            self.stage = "version"

    def heard_version(self, fields: dict[str, Any]) -> None:
        if self.stage != "version":
            return
        packed = int(fields["flight_sw_version"])
        self.version = packed >> 24 & 0xFF, packed >> 16 & 0xFF
        if self.version < OLDEST:
            found = ".".join(map(str, self.version))
            self.refuse(f"it has ArduSub {found}; allowed: 4.5 and newer")
            return
        self.stage = "parameters"
        self._reader.wanted = names(self.version, len(self._vehicle.thruster))
        functions = (f"SERVO{servo}_FUNCTION" for servo in self._servos.values())
        self._reader.optional = *optional(self.version), *ADVISED, *functions

    def heard_parameter(self, fields: dict[str, Any]) -> None:
        name, value = fields["param_id"], float(fields["param_value"])
        if self.stage not in ("accepted", "parameters"):
            return
        before = self._reader.values.get(name, value)
        self._reader.heard(name, value)
        if self.stage == "accepted":
            if abs(before - value) > EXACT:  # somebody set it since it was checked
                self._check()
            return
        if (most := self._settings.set_pilot_timeout) is not None:
            self._reader.lower("FS_PILOT_TIMEOUT", most)
        if self._reader.complete:
            self._check()

    def heard_clock(self, now: Ns) -> None:
        """The board answered a question for its time."""
        if self.stage != "clock" or not self._clock.known:
            return
        self.stage, self.accepted_ns = "accepted", now
        version = ".".join(map(str, self.version))
        bound = self._clock.bound_ns / 1e6
        self._outbox.say(
            "info", f"ArduSub {version} accepted; its clock is known to {bound:.1f} ms"
        )
        for output in self._vehicle.output:
            channel = output.name == LIGHT and not is_new(self.version)
            if not channel and output.name not in self._servos:
                text = f"output {output.name} has no servo in the vehicle file: it does nothing"
                self._outbox.say("info", text)

    def _check(self) -> None:
        values = self._reader.values
        wrong = problems(values, self.version, self._settings, self._vehicle)
        wrong += moved_motors(values, self._servos)
        if wrong:
            for sentence in wrong:
                self.refuse(sentence)
            return
        for sentence in advice(values):
            self._outbox.say("warning", sentence)
        self.mixer = mixer_of(values, self._vehicle)
        self.stage = "accepted" if self.stage == "accepted" else "clock"
