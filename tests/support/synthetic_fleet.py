"""Synthetic drones, or their pilots, on a network: `python -m tests.support.synthetic_fleet -h`.

Each has a hub of its own, as a real one, and joins the router. It says `ready` when all have
joined; what it heard is one line of JSON at its end, after so many seconds or when nobody holds its
standard input open any more.
"""

import argparse
import json
import secrets
import select
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import msgspec

from messages import topics
from messages.topic import Side
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.bus.zenoh_bus import ZenohBus, announce_here, connected, listening
from services.runtime.config.identity import messages_hash
from tests.support.synthetic import ASKED, TICK_HZ, due, said, said_by

CHUNK = 20  # [ticks] messages of the fast rows between two delays that are looked at


class _Stamp(msgspec.Struct):
    stamp_ns: int


class SyntheticHeard:
    """What came, on Zenoh's thread."""

    def __init__(self) -> None:
        self.messages = self.payload = 0  # [1], [bytes]
        self.delays_ms: list[float] = []  # [ms] of some
        self._decode = msgspec.msgpack.Decoder(_Stamp).decode

    def take(self, envelope: Envelope) -> None:
        self.messages += 1
        self.payload += len(envelope.payload)
        if self.messages % CHUNK == 0:
            stamp_ns = self._decode(envelope.payload).stamp_ns
            self.delays_ms.append((time.monotonic_ns() - stamp_ns) / 1e6)


class SyntheticSide:
    """One drone, or the topside of one."""

    def __init__(
        self,
        side: Side,
        name: str,
        router: str,
        folder: str | None,
        heard: SyntheticHeard,
        exits: ExitStack,
    ) -> None:
        """
        Args:
            folder: for the private socket of its hub; None: it has no hub, and is a client itself.
        """
        space = namespace(name)
        if folder is None:
            session = exits.enter_context(connected(router, None))
        else:
            private = f"unixsock-stream/{folder}/{name}.sock"
            border = HubSide(side, space)
            session = exits.enter_context(listening(private, connect=[router], hub_side=border))
        self._here = announce_here(session, here_key(space, side, secrets.token_hex(8)))
        self._bus = ZenohBus(session)
        self.streams = said_by(side, name, messages=messages_hash(topics.ALL))
        self._put = [self._bus.say(stream.topic) for stream in self.streams]
        self._encode = msgspec.msgpack.Encoder().encode
        self._seq = [0] * len(self.streams)
        for topic in ASKED[side]:
            self._bus.hear(f"{space}/{topic.key}", heard.take)

    def speak(self, tick: int, phase: int) -> int:
        """Returns how many messages are due in this tick, and were sent."""
        sent = 0
        for number in due(self.streams, tick, phase):
            self._seq[number] += 1
            message = said(self.streams[number], self._seq[number], time.monotonic_ns())
            self._put[number](self._encode(message))
            sent += 1
        return sent


def run(
    side: Side, router: str, names: Sequence[str], seconds: float, speed: float, *, hubs: bool
) -> None:
    """Speak until the time is over, or standard input is closed.

    Args:
        hubs: each has a hub, as real ones have.
    """
    heard = SyntheticHeard()
    with tempfile.TemporaryDirectory(prefix="lindy-") as folder, ExitStack() as exits:
        with ThreadPoolExecutor(len(names)) as pool:  # each takes half a second to join
            joining = [
                pool.submit(
                    SyntheticSide, side, name, router, folder if hubs else None, heard, exits
                )
                for name in names
            ]
            sides = [each.result() for each in joining]
        print("ready", flush=True)
        began, before, tick, sent, late = time.monotonic(), (0, 0), 0, 0, 0
        while (elapsed := time.monotonic() - began) < seconds and not _closed():
            for phase, each in enumerate(sides):
                sent += each.speak(tick, phase)
            tick += 1
            rest = began + tick / (TICK_HZ * speed) - time.monotonic()
            late += rest < 0.0
            if tick == round(TICK_HZ):  # the first second is not steady
                before = (heard.messages, heard.payload)
            time.sleep(max(0.0, rest))
        delays = sorted(heard.delays_ms)
        print(
            json.dumps(
                {
                    "seconds": elapsed,
                    "said": sent,
                    "late_ticks": late,
                    "heard": heard.messages,
                    "heard_steady": heard.messages - before[0],
                    "payload_steady": heard.payload - before[1],
                    "p50_ms": delays[len(delays) // 2] if delays else None,
                    "p99_ms": delays[len(delays) * 99 // 100] if delays else None,
                }
            ),
            flush=True,
        )


def _closed() -> bool:
    """Does nobody hold standard input open any more?"""
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return bool(ready) and not sys.stdin.readline()


def main(words: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="synthetic_fleet", description=__doc__)
    parser.add_argument("who", choices=("drones", "pilots"))
    parser.add_argument("--router", required=True, help="endpoint of a router")
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--speed", type=float, default=1.0, help="times the table's rates")
    parser.add_argument("--clients", action="store_true", help="clients instead of hubs")
    args = parser.parse_args(words)
    names = [f"synthetic{number}" for number in range(args.first, args.first + args.count)]
    side: Side = "drone" if args.who == "drones" else "topside"
    run(side, args.router, names, args.seconds, args.speed, hubs=not args.clients)


if __name__ == "__main__":
    main(sys.argv[1:])
