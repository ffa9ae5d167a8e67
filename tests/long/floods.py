"""How late a pilot's commands become while an observer floods the drone's hub, by turns with nobody
flooding. Run it on a quiet computer: `python -m tests.long.floods [SECONDS] [TURNS]`.

A real hub with TLS, a pilot's and an observer's certificates, each in a process of its own. The
observer comes again whenever it is cut off.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import zenoh

from services.runtime.bus.envelope import Envelope
from tests.services.runtime.hosts.test_doorkeeper import Door, junk, subscriptions, tokens

SECONDS, TURNS = 15, 3
PILOT_HZ = 50.0  # [1/s] as commands are sent
WARM_S = 2.0  # [s] before it counts
FLOODS = {each.__name__: each for each in (junk, tokens, subscriptions)}


def p99_ms(door: Door, pilot: zenoh.Session, seconds: float) -> float:
    """[ms] From the pilot's program to a service on board."""
    found: list[float] = []

    def hear(envelope: Envelope) -> None:
        if envelope.key == "pilot/request":
            found.append((time.monotonic_ns() - int(envelope.payload)) / 1e6)

    door.bus.hear("pilot/request", hear)
    ends, due = time.monotonic() + seconds, time.monotonic()
    while time.monotonic() < ends:
        pilot.put("pilot/request", str(time.monotonic_ns()).encode())
        due += 1.0 / PILOT_HZ
        time.sleep(max(0.0, due - time.monotonic()))  # a pilot's own clock
    return float(np.percentile(found[round(WARM_S * PILOT_HZ) :], 99))


def beside(door: Door, kind: str, measure: Callable[[], float]) -> float:
    """What is measured while an observer floods so."""
    # Its processor time is that of another computer, and is not to be missed here.
    command = ["nice", "-n", "19", sys.executable, "-m", "tests.long.floods", "flood", kind]
    flood = subprocess.Popen([*command, door.address, str(door.keys)])
    try:
        return measure()
    finally:
        flood.kill()
        flood.wait()


def flood(kind: str, address: str, keys: str) -> None:
    door = Door.__new__(Door)  # its keys and address alone
    door.keys, door.address = Path(keys), address
    kept: list[object] = []
    while True:
        try:
            with door.session("observer-eve") as eve:
                while not eve.is_closed():
                    kept.append(FLOODS[kind](eve, len(kept)))
        except Exception as error:  # cut off
            print(error, file=sys.stderr)


def main(seconds: float, turns: int) -> None:
    with TemporaryDirectory() as folder:
        door = Door(Path(folder))
        try:
            with door.session("pilot-ann") as pilot:
                for turn in range(turns):
                    for kind in FLOODS:
                        alone = p99_ms(door, pilot, seconds)
                        flooded = beside(door, kind, lambda: p99_ms(door, pilot, seconds))
                        print(
                            f"turn {turn + 1}: alone {alone:6.2f} ms, beside {kind:13s} "
                            f"{flooded:6.2f} ms, {flooded / alone:5.1f} times",
                            flush=True,
                        )
        finally:
            door.close()
            print(f"cut off {door.log.count('it is cut off for')} times", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["flood"]:
        flood(*sys.argv[2:])
    given = [float(each) for each in sys.argv[1:]]
    main(given[0] if given else SECONDS, round(given[1]) if len(given) > 1 else TURNS)
