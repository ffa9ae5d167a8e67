"""What is around the drone in the firmware's simulator: a DVL over a bottom, and a current.

The DVL is the double of tests/support/instruments, fed with the simulator's own motion. ArduSub is
told the same reports as BlueOS's extension tells it: as VISION_POSITION_DELTA.
"""

import json
from collections.abc import Sequence
from math import cos, sin
from typing import Any, NamedTuple

from messages.units import Vec3
from services.mavlink_io.packet import MavlinkPacket
from tests.support.instruments.dvl import DvlFaults, DvlSettings, rate, report
from tests.support.instruments.ports import TcpInstrument
from tests.support.instruments.truth import SeenMotion

ABOVE_BOTTOM = 4.0  # [m] wherever the drone is: 13 reports a second
LATENCY_S = 0.02  # [s] from the motion to the report
BEGIN_M = 2.0  # [m] The plan begins some time after the drone was so deep
SURE = 0.4  # [m/s] figure of merit with which the extension has no confidence
Angles = tuple[float, float, float]


class CurrentChange(NamedTuple):
    at: float  # [s] since the plan has begun
    speed: float  # [m/s]
    towards: float  # [deg] 0: north


class Sea:
    def __init__(self, plan: Sequence[CurrentChange], wait_s: float, seed: int = 1) -> None:
        """
        Args:
            wait_s: [s] from the depth BEGIN_M to the plan.
        """
        self.dvl = TcpInstrument(DvlSettings().answers)
        self.began: float | None = None  # [s] UTC, of the plan
        self._plan, self._wait_s, self._seed = list(plan), wait_s, seed
        self._said: float | None = None  # [s] UTC, of the newest report
        self._before: Angles = (0.0, 0.0, 0.0)  # [rad] roll, pitch, yaw at that time

    def see(self, now: float, fields: dict[str, Any]) -> list[MavlinkPacket]:
        """What the board is to be told, after SIM_STATE at `now` [s] UTC."""
        motion = SeenMotion(velocity=in_body(fields), altitude=ABOVE_BOTTOM, depth=-fields["alt"])
        packets = self._measure(now, motion, fields)
        if self.began is None and motion.depth > BEGIN_M:
            self.began = now + self._wait_s
        while self.began is not None and self._plan and now >= self.began + self._plan[0].at:
            change = self._plan.pop(0)
            packets += [_set("SIM_WIND_SPD", change.speed), _set("SIM_WIND_DIR", change.towards)]
        return packets

    def _measure(
        self, now: float, motion: SeenMotion, fields: dict[str, Any]
    ) -> list[MavlinkPacket]:
        faults = DvlFaults(latency=LATENCY_S)
        since = None if self._said is None else now - self._said
        if since is not None and since < 1.0 / rate(motion, faults):
            return []
        line, self._said = report(motion, now, self._seed, faults), now
        self.dvl.says(line)
        angles = fields["roll"], fields["pitch"], fields["yaw"]
        before, self._before = self._before, angles
        if since is None:
            return []
        said = json.loads(line)
        turned = [a - b for a, b in zip(angles, before, strict=True)]
        return [
            MavlinkPacket(
                "VISION_POSITION_DELTA",
                {
                    "time_usec": round(now * 1e6),
                    "time_delta_usec": round(since * 1e6),
                    "angle_delta": turned,
                    "position_delta": [since * said[axis] for axis in ("vx", "vy", "vz")],
                    "confidence": 100.0 * max(0.0, 1.0 - said["fom"] / SURE),
                },
            )
        ]


def in_body(fields: dict[str, Any]) -> Vec3:
    """[m/s] The velocity of SIM_STATE, north, east, down, in the vehicle's axes."""
    n, e, d = fields["vn"], fields["ve"], fields["vd"]
    roll, pitch, yaw = fields["roll"], fields["pitch"], fields["yaw"]
    ahead, across = cos(yaw) * n + sin(yaw) * e, -sin(yaw) * n + cos(yaw) * e
    x, z = cos(pitch) * ahead - sin(pitch) * d, sin(pitch) * ahead + cos(pitch) * d
    return x, cos(roll) * across + sin(roll) * z, -sin(roll) * across + cos(roll) * z


def _set(name: str, value: float) -> MavlinkPacket:
    return MavlinkPacket(
        "PARAM_SET",
        {
            "target_system": 1,
            "target_component": 1,
            "param_id": name,
            "param_value": value,
            "param_type": 9,
        },
    )
