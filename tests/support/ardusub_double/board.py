"""The board: a pure state machine of (packets, time) that answers as ArduSub does.

It runs at 200 Hz and takes its inputs at 50 Hz. As on every tethered ROV there is no RC receiver:
a released override keeps its last value, and nothing but a failsafe takes it away.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import ARDUPILOT, MavlinkPacket, MavResult
from services.simulator.core import Settings
from tests.support.ardusub_double.motors import REST, SPOOL_S, axes_of, motor_pulses
from tests.support.ardusub_double.settings import LIMITS, VERSIONS, defaults
from tests.support.ardusub_double.telemetry import MISSCALED, HullDouble

MS, S = 1_000_000, 1_000_000_000  # [ns]
TICK_NS, INPUT_NS, GCS_CHECK_NS = 5 * MS, 20 * MS, S // 3
TAKEN_OVER_NS = 100 * MS  # [ns] a value of depth sensor and compass stays for as long
MANUAL, STABILIZE = 19, 0
MODES = (0, 1, 2, 3, 4, 7, 9, 16, 19, 20, 21)
DENIED, UNSUPPORTED, FAILED = 2, 3, 4  # results of a command
NUMBERS = {
    "SYS_STATUS": 1, "RAW_IMU": 27, "SCALED_PRESSURE": 29, "ATTITUDE": 30, "SERVO_OUTPUT_RAW": 36,
    "HIGHRES_IMU": 105, "SCALED_IMU2": 116, "SCALED_PRESSURE2": 137,
}  # fmt: skip
STREAMS = {number: name for name, number in NUMBERS.items()}
ONLY_IN_48 = ("HIGHRES_IMU",)
DISARM = 2  # action of a failsafe
GCS_LOST_45_S = 2.5  # [s] fixed
LEAK_EVERY_NS = 20 * S
CRITICAL, ACTIVE, STANDBY = 5, 4, 3  # system_status


class BoardDouble:
    def __init__(
        self,
        vehicle: Vehicle,
        settings: Settings,
        *,
        version: str = "4.8",
        params: dict[str, float] | None = None,
        seed: int = 0,
        wired_as: int = 2,
        system: int = 1,
        kind: int = 12,
        autopilot: int = ARDUPILOT,
    ) -> None:
        """
        Args:
            version: of `settings.VERSIONS`.
            params: other than the defaults.
            kind: MAV_TYPE; 12 is a submarine.
        """
        self.version, self.system = version, system
        self.params = {**defaults(version), **(params or {})}
        self.stuck: set[str] = set()  # parameters that will not be set
        self.missing: set[str] = set()  # messages that it does not have
        self.refuses = ""  # to arm: why
        self.slowest_us: dict[str, int] = {}  # [µs] least interval of a message that it reaches
        compass = MISSCALED if version == "4.7-early" else 1.0
        self.hull = HullDouble(vehicle, settings, seed, wired_as, compass)
        self.armed, self.mode = False, MANUAL
        self.servo = [REST] * len(vehicle.thruster)  # [µs]
        self.texts: list[str] = []  # of STATUSTEXT, for tests
        self.clock_ahead_ns = 0  # [ns] of its clock, for tests that let it jump
        self.set_servos: dict[int, float] = {}  # [µs] by number, from DO_SET_SERVO
        self._kind, self._autopilot = kind, autopilot
        self._out: deque[MavlinkPacket] = deque()
        self._started = False
        self._boot = self._next = 0
        self._reset()

    def _reset(self) -> None:
        self.armed, self.mode, self.leaking = False, MANUAL, False
        self.override = [float(REST)] * 8 + [1100.0] * 10  # [µs] latched
        self._input = [float(REST)] * 6  # as taken at 50 Hz
        self._armed_ns = 0
        self._pilot_ns: int | None = None
        self._pilot_lost = True  # acts on a change only
        self._gcs_ns: int | None = None
        self._gcs_lost = False
        self.streams: dict[str, list[int]] = {}  # interval and next time [ns]
        self._leak_ns = self._heartbeat_ns = self._input_ns = -LEAK_EVERY_NS
        self._gcs_check_ns = self._taken_over_ns = -LEAK_EVERY_NS

    # What tests do to it.

    def reboot(self, now: int) -> None:
        """As a brown-out does: everything but the parameters is forgotten, and the clock is 0."""
        self._reset()
        self._boot = now
        self._drive(now)

    def boot_us(self, now: int) -> int:
        return (now - self._boot + self.clock_ahead_ns) // 1000

    @property
    def light(self) -> float:
        """[µs] Of the lights' output: from channel 9, in 4.5 only."""
        return self.override[8] if self.version == "4.5" else 1100.0

    # Time.

    def advance(self, now: int) -> None:
        """Up to `now` [ns]."""
        if not self._started:
            self._started, self._boot, self._next = True, now, now
        while self._next <= now:
            self._tick(self._next)
            self._next += TICK_NS

    def sent(self) -> list[MavlinkPacket]:
        """What it has said since."""
        packets = list(self._out)
        self._out.clear()
        return packets

    def _tick(self, now: int) -> None:
        self._failsafes(now)
        if now - self._input_ns >= INPUT_NS:
            self._input_ns, self._input = now, self.override[:6]
            self._drive(now)
            self.hull.measure(now)
        if now - self._taken_over_ns >= TAKEN_OVER_NS:
            self._taken_over_ns = now
            self.hull.take_over()
        if now - self._heartbeat_ns >= S:
            self._heartbeat_ns = now
            self._say_heartbeat()
        silent = now - self._boot < LEAK_EVERY_NS  # nothing is said in the first 20 s
        if self.leaking and not silent and now - self._leak_ns >= LEAK_EVERY_NS:
            self._leak_ns = now
            self._text(2, "Leak Detected")
        for name, due in self.streams.items():
            if now >= due[1]:
                due[1] = max(due[1] + due[0], now)
                self._telemetry(name, now)

    def _drive(self, now: int) -> None:
        spooled = self.armed and now - self._armed_ns >= SPOOL_S * S
        mixes = self.mode in (MANUAL, STABILIZE)
        if spooled and mixes and not (self._pilot_lost and self._pilot_ns is not None):
            axes = axes_of(self._input, self.params, self.version)
            self.servo = motor_pulses(axes, self.params)
        else:
            self.servo = [REST] * len(self.servo)
        self.hull.drive(self.servo, now)

    def _failsafes(self, now: int) -> None:
        timeout = round(self.params["FS_PILOT_TIMEOUT"] * S)
        action = self.params["FS_PILOT_INPUT"]
        if self._pilot_ns is not None and now - self._pilot_ns <= timeout:
            self._pilot_lost = False
        elif action and not self._pilot_lost:
            self._pilot_lost = True
            self._text(2, "Lost manual control")
            if action == DISARM:
                self._disarm(now)
            self._drive(now)
        if now - self._gcs_check_ns < GCS_CHECK_NS:
            return
        self._gcs_check_ns = now
        limit = self.params.get("FS_GCS_TIMEOUT", GCS_LOST_45_S)
        if self._gcs_ns is None or not self.params["FS_GCS_ENABLE"]:
            return
        lost = now - self._gcs_ns > limit * S
        if lost and not self._gcs_lost:
            self._text(4, f"MYGCS: {self._gcs_id()}, heartbeat lost")
            if self.params["FS_GCS_ENABLE"] == DISARM:
                self._disarm(now)
        self._gcs_lost = lost

    # What it hears.

    def hear(self, packet: MavlinkPacket, now: int) -> None:
        self.advance(now)
        handler: dict[str, Callable[[MavlinkPacket, int], None]] = {
            "HEARTBEAT": self._heard_heartbeat,
            "RC_CHANNELS_OVERRIDE": self._heard_override,
            "COMMAND_LONG": self._heard_command,
            "PARAM_REQUEST_READ": self._heard_read,
            "PARAM_SET": self._heard_set,
            "TIMESYNC": self._heard_timesync,
        }
        if packet.name in handler:
            handler[packet.name](packet, now)

    def _gcs_id(self) -> int:
        return int(
            self.params["MAV_GCS_SYSID" if "MAV_GCS_SYSID" in self.params else "SYSID_MYGCS"]
        )

    def _is_gcs(self, system: int) -> bool:
        high = int(self.params.get("MAV_GCS_SYSID_HI", 0))
        return system == self._gcs_id() or self._gcs_id() < system <= high

    def _heard_heartbeat(self, packet: MavlinkPacket, now: int) -> None:
        if self._is_gcs(packet.system):
            self._gcs_ns = now

    def _heard_override(self, packet: MavlinkPacket, now: int) -> None:
        """Silently ignored from another system than the ground station's."""
        if not self._is_gcs(packet.system) or packet.fields["target_system"] != self.system:
            return
        if self.params["RC_OVERRIDE_TIME"] == 0:
            return
        self._pilot_ns = self._gcs_ns = now
        for n in range(18):
            pulse = packet.fields.get(f"chan{n + 1}_raw", 0)
            if pulse not in (0, 65534, 65535):  # released is not neutral: the last value stays
                self.override[n] = float(pulse)

    def _heard_command(self, packet: MavlinkPacket, now: int) -> None:
        """From any system; those to another one get no answer."""
        fields = packet.fields
        if fields["target_system"] not in (0, self.system):
            return
        number = fields["command"]
        handler: dict[int, Callable[[dict[str, Any], int], int]] = {
            400: self._arm_or_disarm, 176: self._set_mode, 511: self._set_interval,
            512: self._request, 183: self._set_servo,
        }  # fmt: skip
        result = handler[number](fields, now) if number in handler else UNSUPPORTED
        self._say("COMMAND_ACK", {"command": number, "result": result})

    def _arm_or_disarm(self, fields: dict[str, Any], now: int) -> int:
        if not fields["param1"]:
            self._disarm(now)
            return MavResult.ACCEPTED
        if self.refuses:
            self._text(2, self.refuses)
            return FAILED
        throttle = self.override[2]
        if self.version != "4.5" and abs(throttle - self.params["RC3_TRIM"]) > 30:
            self._text(2, "PreArm: Throttle not centered/close to trim")
            return FAILED
        if not self.armed:
            self.armed, self._armed_ns = True, now
            self._text(6, "Arming motors")
        return MavResult.ACCEPTED

    def _disarm(self, now: int) -> None:
        if self.armed:
            self.armed = False
            self._text(6, "Disarming motors")
            self._drive(now)

    def _set_mode(self, fields: dict[str, Any], now: int) -> int:
        mode = int(fields["param2"])
        if mode not in MODES:
            return FAILED
        if mode == MANUAL and self.mode != MANUAL:
            self.override[:6] = self._input = [float(REST)] * 6
        self.mode = mode
        self._drive(now)
        return MavResult.ACCEPTED

    def _set_interval(self, fields: dict[str, Any], now: int) -> int:
        name = STREAMS.get(int(fields["param1"]))
        too_new = name in ONLY_IN_48 and self.version == "4.5"
        if name is None or too_new or name in self.missing:
            return DENIED
        interval = int(fields["param2"])
        if interval <= 0:  # 0: the default, which is none
            self.streams.pop(name, None)
        else:
            slowest = max(interval, self.slowest_us.get(name, 0))
            whole = max(5 * MS, round(slowest / 1000) * MS)  # in whole milliseconds
            self.streams[name] = [whole, now]
        return MavResult.ACCEPTED

    def _request(self, fields: dict[str, Any], _: int) -> int:
        if int(fields["param1"]) != 148:
            return DENIED
        zeros = ("capabilities", "middleware_sw_version", "os_sw_version", "board_version",
                 "vendor_id", "product_id", "uid")  # fmt: skip
        self._say("AUTOPILOT_VERSION", {
            **dict.fromkeys(zeros, 0),
            "flight_sw_version": VERSIONS.get(self.version, 0x04010000),
            "flight_custom_version": [0] * 8,
            "middleware_custom_version": [0] * 8,
            "os_custom_version": [0] * 8,
        })  # fmt: skip
        return MavResult.ACCEPTED

    def _set_servo(self, fields: dict[str, Any], _: int) -> int:
        """As ServoRelayEvents does: only an output that has no function."""
        number = int(fields["param1"])
        if self.params.get(f"SERVO{number}_FUNCTION", -1.0) != 0.0:
            return FAILED
        self.set_servos[number] = fields["param2"]
        return MavResult.ACCEPTED

    def _heard_read(self, packet: MavlinkPacket, _: int) -> None:
        if (name := packet.fields["param_id"]) in self.params:
            self._say_param(name)

    def _heard_set(self, packet: MavlinkPacket, _: int) -> None:
        name, value = packet.fields["param_id"], float(packet.fields["param_value"])
        if name not in self.params:
            return
        if name not in self.stuck:
            least, most = LIMITS.get(name, (-1e9, 1e9))
            self.params[name] = max(least, min(most, value))
        self._say_param(name)

    def _heard_timesync(self, packet: MavlinkPacket, now: int) -> None:
        if packet.fields["tc1"] == 0:
            self._say("TIMESYNC", {"tc1": 1000 * self.boot_us(now), "ts1": packet.fields["ts1"]})

    # What it says.

    def _say(self, name: str, fields: dict[str, Any]) -> None:
        self._out.append(MavlinkPacket(name, fields, self.system, 1))

    def _text(self, severity: int, text: str) -> None:
        self.texts.append(text)
        self._say("STATUSTEXT", {"severity": severity, "text": text})

    def _say_heartbeat(self) -> None:
        lost = self._pilot_lost or self._gcs_lost
        self._say("HEARTBEAT", {
            "type": self._kind, "autopilot": self._autopilot,
            "base_mode": 1 | (128 if self.armed else 0), "custom_mode": self.mode,
            "system_status": CRITICAL if lost else ACTIVE if self.armed else STANDBY,
            "mavlink_version": 3,
        })  # fmt: skip

    def _say_param(self, name: str) -> None:
        self._say("PARAM_VALUE", {
            "param_id": name, "param_value": float(self.params[name]), "param_type": 9,
            "param_count": len(self.params), "param_index": list(self.params).index(name),
        })  # fmt: skip

    def _telemetry(self, name: str, now: int) -> None:
        boot_us = self.boot_us(now)
        if name == "SERVO_OUTPUT_RAW":
            self._say(name, {"time_usec": boot_us % 2**32, "port": 0, **{
                f"servo{n}_raw": pulse for n, pulse in enumerate([*self.servo, *[0] * 8][:8], 1)
            }})  # fmt: skip
        elif (packet := self.hull.message(name, boot_us, now)) is not None:
            self._say(packet.name, packet.fields)
