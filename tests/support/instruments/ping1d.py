"""A double of the Ping1D, from its maker's pages (docs/index.md and src/definitions/ping1d.json in
github.com/bluerobotics/ping-protocol). It says nothing unasked."""

import struct
from typing import Literal

from tests.support.instruments.truth import SeenMotion, drawn

Fault = Literal[
    "air",
    "multipath",
    "fish",
    "off",  # it does not ping, and tells its newest ping again
    "absurd",  # 4,000 km
]
ACK, NACK, DEVICE, REQUEST, SET_SPEED, ENABLE, DISTANCE, PROFILE = (
    *(1, 2, 4, 6, 1002, 1006, 1212, 1300),
)


def packed(message: int, payload: bytes) -> bytes:
    data = b"BR" + struct.pack("<HHBB", len(payload), message, 1, 0) + payload
    return data + struct.pack("<H", sum(data) % 65536)


def distance(
    motion: SeenMotion,
    number: int,
    seed: int,
    faults: frozenset[Fault] = frozenset(),
    echo: int = 0,
) -> bytes:
    """The message `distance` of one ping; a `profile` with so many points of its echo."""
    random = drawn(seed, float(number), "ping1d")
    metres, confidence = motion.altitude + random.gauss(0.0, 0.005), 98
    if "air" in faults:
        metres, confidence = random.uniform(0.0, 30.0), random.randrange(40)
    if "multipath" in faults:
        metres *= 2.0
    if "fish" in faults:
        metres, confidence = 0.4 * metres, 80
    if "absurd" in faults:
        metres = 4e6
    head = struct.pack("<IHHIIII", max(0, round(metres * 1000)), confidence, 64, number, 0, 5000, 3)
    if echo:
        return packed(PROFILE, head + struct.pack("<H", echo) + bytes(echo))
    return packed(DISTANCE, head)


class Ping1dDouble:
    """Answers what it is asked, at one ping a question."""

    def __init__(self, seed: int = 0, faults: frozenset[Fault] = frozenset()) -> None:
        self.motion, self.faults, self._seed, self.number = SeenMotion(), faults, seed, 0
        self.sound_speed = 1_500_000  # [mm/s]
        self.on = "off" not in faults

    def answers(self, asked: bytes) -> bytes:
        said = b""
        while asked[:2] == b"BR":
            length, message = struct.unpack("<HH", asked[2:6])
            payload, asked = asked[8 : 8 + length], asked[10 + length :]
            said += self._answer(message, payload)
        return said

    def _answer(self, message: int, payload: bytes) -> bytes:
        if message == SET_SPEED:
            self.sound_speed = int.from_bytes(payload, "little")
            return packed(ACK, struct.pack("<H", message))
        if message == ENABLE:
            self.on = "off" not in self.faults and payload == b"\x01"
            return packed(ACK, struct.pack("<H", message))
        if message == REQUEST and payload == struct.pack("<H", DEVICE):
            return packed(DEVICE, bytes([1, 1, 3, 29, 0, 0]))
        if message != REQUEST or payload != struct.pack("<H", DISTANCE):
            return packed(NACK, struct.pack("<H", message) + b"not known here")
        self.number += self.on
        return distance(self.motion, self.number, self._seed, self.faults)
