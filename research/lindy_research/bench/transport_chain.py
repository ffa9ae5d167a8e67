"""One process of the neutral chain: `python -m lindy_research.bench.transport_chain ROLE TRANSPORT
FOLDER`. It says `ready`, and ends with one line of JSON when its stdin is closed.

source → estimation → reference → control → sink at 100 Hz; a recorder hears all four streams, and
two more listeners the state: 1000 deliveries a second. What a process hears it answers at once.
"""

import json
import os
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import msgspec

from lindy.api.messages import topics
from messages.topic import AnyTopic
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.hosts.loop import rare_collections

HZ = 100.0
STREAMS: tuple[str, ...] = ("imu", "state", "reference", "wrench")
TOPIC: dict[str, AnyTopic] = {
    "imu": topics.IMU, "state": topics.STATE, "reference": topics.REFERENCE,
    "wrench": topics.WRENCH,
}  # fmt: skip
FLOATS = {"imu": 20, "state": 97, "reference": 36, "wrench": 31}  # 200, 900, 350 and 300 B
HEARS = {
    "source": (), "estimation": ("imu",), "reference": ("state",), "control": ("reference",),
    "sink": ("wrench",), "recorder": STREAMS, "listener_1": ("state",), "listener_2": ("state",),
}  # fmt: skip
SAYS = {"source": "imu", "estimation": "state", "reference": "reference", "control": "wrench"}
SAYER = {stream: role for role, stream in SAYS.items()}


class ChainMessage(msgspec.Struct):
    seq: int
    stamp_ns: int  # of the source
    values: list[float]


Heard = Callable[[str, bytes], None]  # stream, payload


class Transport(Protocol):
    """How messages travel. `run` returns when the process is to end."""

    def say(self, stream: str, payload: bytes) -> None: ...

    def run(self, ended: threading.Event) -> None: ...


class OverZenoh:
    """As the services have it: on Zenoh's thread."""

    def __init__(self, role: str, folder: Path, heard: Heard, exits: ExitStack) -> None:
        bus = exits.enter_context(open_bus(f"unixsock-stream/{folder}/hub.sock", "bench"))
        self._say = {stream: bus.say(TOPIC[stream]) for stream in STREAMS}
        for stream in HEARS[role]:
            bus.hear(TOPIC[stream].key, lambda e, stream=stream: heard(stream, e.payload))

    def say(self, stream: str, payload: bytes) -> None:
        self._say[stream](payload)

    def run(self, ended: threading.Event) -> None:
        ended.wait()


class OverZmq:
    """pyzmq PUB/SUB over ipc, an endpoint for each stream."""

    def __init__(self, role: str, folder: Path, heard: Heard, exits: ExitStack) -> None:
        import zmq  # not everybody has it

        context: Any = exits.enter_context(zmq.Context())
        self._out = context.socket(zmq.PUB)
        if role in SAYS:
            self._out.bind(f"ipc://{folder}/{SAYS[role]}.zmq")
        self._in = context.socket(zmq.SUB)
        self._in.subscribe(b"")
        self._in.setsockopt(zmq.RCVTIMEO, 200)  # [ms]
        for stream in HEARS[role]:
            self._in.connect(f"ipc://{folder}/{stream}.zmq")
        exits.callback(self._out.close, 0)
        exits.callback(self._in.close, 0)
        self._again, self._heard, self._listens = zmq.Again, heard, bool(HEARS[role])

    def say(self, stream: str, payload: bytes) -> None:
        self._out.send_multipart((stream.encode(), payload))

    def run(self, ended: threading.Event) -> None:
        if not self._listens:
            ended.wait()
        while not ended.is_set():
            try:
                stream, payload = self._in.recv_multipart()
            except self._again:
                continue
            self._heard(stream.decode(), payload)


class OverSockets:
    """Datagrams from each speaker to each listener: the floor."""

    def __init__(self, role: str, folder: Path, heard: Heard, exits: ExitStack) -> None:
        self._socket = exits.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
        self._socket.bind(f"{folder}/{role}.dgram")
        self._socket.settimeout(0.2)
        self._out = exits.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
        self._out.setblocking(False)
        self._heard, self._folder = heard, folder
        self.unsent = 0

    def say(self, stream: str, payload: bytes) -> None:
        datagram = bytes([STREAMS.index(stream)]) + payload
        for role, hears in HEARS.items():
            if stream in hears:
                try:
                    self._out.sendto(datagram, f"{self._folder}/{role}.dgram")
                except BlockingIOError:  # the listener's buffer is full
                    self.unsent += 1

    def run(self, ended: threading.Event) -> None:
        while not ended.is_set():
            try:
                datagram = self._socket.recv(65536)
            except TimeoutError:
                continue
            self._heard(STREAMS[datagram[0]], datagram[1:])


TRANSPORTS: dict[str, Callable[[str, Path, Heard, ExitStack], Transport]] = {
    "zenoh": OverZenoh, "zmq": OverZmq, "sockets": OverSockets,
}  # fmt: skip


class Worker:
    """What a role does with what it hears."""

    def __init__(self, role: str) -> None:
        self.role = role
        self.delays = list[float]()  # [ms] from the source, at the sink
        self.heard_of: Counter[str] = Counter()
        self.transport: Transport  # set before anything is heard
        self._encode = msgspec.msgpack.Encoder().encode
        self._decode = msgspec.msgpack.Decoder(ChainMessage).decode

    def hear(self, stream: str, payload: bytes) -> None:
        message = self._decode(payload)
        self.heard_of[stream] += 1
        if self.role == "sink":
            self.delays.append((time.monotonic_ns() - message.stamp_ns) / 1e6)
        elif self.role in SAYS:
            self.speak(message.seq, message.stamp_ns)

    def speak(self, seq: int, stamp_ns: int) -> None:
        stream = SAYS[self.role]
        values = [float(seq)] * FLOATS[stream]
        self.transport.say(stream, self._encode(ChainMessage(seq, stamp_ns, values)))

    def tick(self, ended: threading.Event) -> int:
        """The source's loop, until the end. Returns how many messages it has said."""
        begin, seq = time.monotonic_ns(), 0
        while True:
            due = begin + round((seq + 1) * 1e9 / HZ)
            if ended.wait(max(0.0, (due - time.monotonic_ns()) / 1e9)):
                return seq
            self.speak(seq, time.monotonic_ns())
            seq += 1


def main(role: str, transport: str, folder: str) -> None:
    worker, ended, ready = Worker(role), threading.Event(), threading.Event()

    def heard(stream: str, payload: bytes) -> None:
        ready.wait()
        worker.hear(stream, payload)

    with ExitStack() as exits:
        worker.transport = TRANSPORTS[transport](role, Path(folder), heard, exits)
        ready.set()
        exits.enter_context(rare_collections())
        print("ready", flush=True)
        if role == "source":
            sys.stdin.readline()  # all the others are ready
        threading.Thread(target=partial(_until_closed, ended), daemon=True).start()
        said = worker.tick(ended) if role == "source" else worker.transport.run(ended)
    print(json.dumps({"said": said, "heard": worker.heard_of, "delays": worker.delays}), flush=True)
    os._exit(0)  # the thread that reads stdin holds its lock


def _until_closed(ended: threading.Event) -> None:
    sys.stdin.read()
    ended.set()


if __name__ == "__main__":
    main(*sys.argv[1:])
