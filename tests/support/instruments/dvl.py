"""A double of the Water Linked DVL A50, from its maker's pages "DVL protocol", "Axes" and "Dead
reckoning" (docs/dvl/ in github.com/waterlinked/waterlinked.github.io). What a fault looks like on
the wire is from the same pages, where they show it: without lock, velocities are 0, the figure of
merit is 2.707 and the altitude is -1, about once a second."""

import json
from math import cos, pi, radians, sin
from typing import Any, Literal, NamedTuple

from messages.units import Vec3
from tests.support.instruments.truth import SeenMotion, drawn

Fault = Literal[
    "no_lock",  # the bottom is too far
    "air",  # the same, and it gets too hot
    "fish",  # takes a school of fish for the bottom, and says that all is well
    "multipath",  # takes the second echo: twice the altitude
    "nan",
    "negative_altitude",
    "zero_covariance",
    "future",  # its time of validity is after its time of transmission
    "old_firmware",  # json_v1
    "new_firmware",  # a format nobody knows yet
    "other_device",  # JSON of something else
]
FISH: Vec3 = (0.6, -0.3, 0.0)  # [m/s] of the school, in the vehicle's axes
BOOT_US = 1_638_191_471_000_000  # its clock is nobody's


class DvlFaults(NamedTuple):
    kinds: frozenset[Fault] = frozenset()
    latency: float = 0.1  # [s] from the echo to the report
    mounted: float = 0.0  # [deg] about Z, from the vehicle's forward axis to the instrument's


SOUND = DvlFaults()


def rate(motion: SeenMotion, faults: DvlFaults) -> float:
    """[1/s] 26 near the bottom, 2 far from it; 1 while it looks for it."""
    if faults.kinds & {"no_lock", "air"}:
        return 1.0
    return min(26.0, max(2.0, 52.0 / max(motion.altitude, 0.1)))


def report(
    motion: SeenMotion, t: float, seed: int, faults: DvlFaults = SOUND, offset: float = 0.0
) -> bytes:
    """The velocity report of an echo at `t` [s], as one line.

    Args:
        offset: [deg] its setting mounting_rotation_offset: it turns its axes back by so much.
    """
    kinds = faults.kinds
    if "other_device" in kinds:
        return b'{"altitude": {"value": 3}, "velocity_valid": "yes", "vx": "fast"}\n'
    locked = not kinds & {"no_lock", "air"}
    said: dict[str, Any] = {"time": 1000.0 / rate(motion, faults)}
    said |= _measured(motion, t, seed, faults, offset) if locked else _nothing()
    if "old_firmware" in kinds:
        return _line(said | {"format": "json_v1"})
    validity = BOOT_US + round(t * 1e6)
    sent = validity + round(faults.latency * 1e6)
    if "future" in kinds:
        validity = sent + 400_000
    times = {"time_of_validity": validity, "time_of_transmission": sent}
    fom = said["fom"]
    variance = 0.0 if "zero_covariance" in kinds or not locked else fom * fom
    covariance = [[variance if i == j else 0.0 for j in range(3)] for i in range(3)]
    kind = "json_v9" if "new_firmware" in kinds else "json_v3"
    status = int("air" in kinds)
    return _line(
        said
        | {"covariance": covariance, "status": status, "format": kind, "type": "velocity"}
        | times
    )


def _nothing() -> dict[str, Any]:
    none = {"velocity": 0, "distance": -1, "rssi": -70, "nsd": -89, "beam_valid": False}
    beams = [{"id": n, **none} for n in range(4)]
    return {
        "vx": 0, "vy": 0, "vz": 0, "fom": 2.707, "altitude": -1, "transducers": beams,
        "velocity_valid": False, "status": 0,
    }  # fmt: skip


def _measured(
    motion: SeenMotion, t: float, seed: int, faults: DvlFaults, offset: float
) -> dict[str, Any]:
    random, kinds = drawn(seed, t, "dvl"), faults.kinds
    std = 0.002 + 0.005 * abs(motion.velocity[0])
    velocity, altitude = motion.velocity, motion.altitude
    if "fish" in kinds:
        velocity = tuple(v - f for v, f in zip(velocity, FISH, strict=True))
        altitude *= 0.4
    if "multipath" in kinds:
        altitude *= 2.0
    vx, vy, vz = velocity
    turn = radians(faults.mounted - offset)  # of the axes it speaks in, from the vehicle's
    x, y = cos(turn) * vx + sin(turn) * vy, -sin(turn) * vx + cos(turn) * vy
    x, y, z = (value + random.gauss(0.0, std) for value in (x, y, vz))
    beam = altitude / cos(pi / 8)
    beams = [
        {"id": n, "velocity": z, "distance": beam, "rssi": -31.0, "nsd": -89.0, "beam_valid": True}
        for n in range(4)
    ]
    return {
        "vx": float("nan") if "nan" in kinds else x,
        "vy": y,
        "vz": z,
        "fom": std,
        "altitude": -altitude if "negative_altitude" in kinds else altitude,
        "transducers": beams,
        "velocity_valid": True,
        "status": 0,
    }


def position(motion: SeenMotion, t: float) -> bytes:
    """Its own dead reckoning, five times a second."""
    said = {"ts": t, "x": motion.north, "y": motion.east, "z": motion.depth, "std": 0.01}
    angles = {"roll": 0.0, "pitch": 0.0, "yaw": motion.heading}
    return _line(said | angles | {"type": "position_local", "status": 0, "format": "json_v2"})


class DvlSettings:
    """What it is set up with, and its answers to commands."""

    def __init__(self, **changed: object) -> None:
        self.config: dict[str, Any] = {
            "speed_of_sound": 1475, "acoustic_enabled": True, "dark_mode_enabled": False,
            "mounting_rotation_offset": 0.0, "range_mode": "auto", **changed,
        }  # fmt: skip
        self.done: list[str] = []  # commands, in order

    def answers(self, line: bytes) -> bytes:
        asked = json.loads(line)
        name, error, result = asked["command"], "", None
        if name == "get_config":
            result = self.config
        elif name == "set_config" and set(asked["parameters"]) <= set(self.config):
            self.config |= asked["parameters"]
        elif name != "calibrate_gyro":
            error = "Unknown command or parameter"
        self.done.append(name)
        reply = {"response_to": name, "success": not error, "error_message": error}
        return _line(reply | {"result": result, "format": "json_v3", "type": "response"})


def _line(said: dict[str, Any]) -> bytes:
    return json.dumps(said).encode() + b"\r\n"
