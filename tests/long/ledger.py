"""What every dive was, byte for byte: 3 vehicles × 3 links × 20 seeds on virtual time, with a hash
of each stream of each. As a script, `python -m tests.long.ledger FILE` writes the file where there
is none, which is for the code before a change; else it compares today's code with it and says which
streams differ in how many dives of which link. `--every 10` flies each tenth only.

Each seed draws its own sticks and events beside its noise and the link's fates, so a change of
behaviour that one dive does not show another one does. A pure move changes nothing. Where messages
change on purpose, the streams that say what the vehicle does (`MOTION`) stay; not over `severe`,
whose rate is so low that a longer message delays the next one.
"""

import argparse
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, cast

from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.sweep.all_cores import in_order

VEHICLES = ("pioneer", "bluerov2_heavy", "minerva")
LINKS = ("perfect", "tether", "severe")
SEEDS = range(20)
SECONDS = 32.0  # [s] the whole dive
CALIBRATION = "estimation.calibration.still_time=3"  # [s] less to wait for
LEFT_OUT = ("recorder", "visualizer")
MOTION = (
    *("state", "reference", "control/wrench", "control/thrusters", "vehicle/actuation"),
    *("simulator/truth", "pilot/command", "pilot/answer", "vehicle/status"),
)
EVENTS = (
    *("stop", "mode manual", "mode heading_hold", "mode stabilised", "mode depth_hold"),
    *("goto depth=2 heading=90", "light", "link down", "link up", "fault sensor/pressure silent"),
    *("fault vertical weak 0.5", "fault sensor/imu noisy", "fault all none", "lost", "resume"),
)
STICKS = (-1.0, -0.5, 0.0, 0.0, 0.0, 0.4, 0.7, 1.0)
DIGITS = 12  # of a hash


class Dive(NamedTuple):
    vehicle: str
    link: str
    seed: int

    @property
    def name(self) -> str:
        return f"{self.vehicle} {self.link} {self.seed}"


def script(seed: int) -> str:
    """Sticks of all axes at random; every third row also an event."""
    chance, at, rows = Random(seed), 0.5, ["t,surge,sway,heave,yaw,event", "0,0,0,0,0,"]
    rows += ["0.5,0,0,0.7,0,"]  # first down: what follows is under water
    while (at := at + chance.uniform(0.4, 2.5)) < SECONDS - 8:
        sticks = ",".join(f"{chance.choice(STICKS):g}" for _ in range(4))
        event = chance.choice(EVENTS) if chance.random() < 1 / 3 else ""
        rows.append(f"{at:.2f},{'0,0,0,0' if event == 'lost' else sticks},{event}")
    return "\n".join([*rows, f"{SECONDS:g},0,0,0,0,", ""])


def flown(dive: Dive) -> dict[str, str]:
    """A hash of each key of a dive, over payloads and times of arrival."""
    hashes: dict[str, Any] = {}

    def keep(envelope: Envelope, arrival: int) -> None:
        one = hashes.setdefault(envelope.key, hashlib.sha256())
        one.update(f"{len(envelope.payload)} {arrival} ".encode())
        one.update(envelope.payload)

    with TemporaryDirectory() as folder:
        path = Path(folder) / "script.csv"
        path.write_text(script(dive.seed))
        services = Registry.read()
        names = [name for name in services if name not in LEFT_OUT]
        stack = Stack(
            vehicle=dive.vehicle,
            link=dive.link,
            pilot=f"script:{path}",
            seed=dive.seed,
            out=folder,
            virtual=True,
            overrides=[CALIBRATION],
        )
        host = VirtualHost()
        host.add_all(services.only({name: services[name] for name in names}), stack)
        for side in ("drone", "topside"):
            node = host.node(f"ledger_{side}", [side])
            node.tap(side, "**", keep)
        host.run(round(SECONDS * 1e9))
        host.close()
    return {key: one.hexdigest()[:DIGITS] for key, one in sorted(hashes.items())}


def fly(every: int) -> dict[str, dict[str, str]]:
    dives = [Dive(*one) for one in product(VEHICLES, LINKS, SEEDS)][::every]
    return dict(zip([dive.name for dive in dives], in_order(flown, dives), strict=True))


def differences(
    before: dict[str, dict[str, str]], now: dict[str, dict[str, str]]
) -> dict[str, Counter[str]]:
    """Stream → link → in how many dives it is another one than before, or on one side only."""
    found: dict[str, Counter[str]] = {}
    for name, new in now.items():
        old, link = before.get(name, {}), name.split()[1]
        for key in {*old, *new}:
            if old.get(key) != new.get(key):
                found.setdefault(key, Counter())[link] += 1
    return found


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="ledger", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--every", type=int, default=1)
    args = parser.parse_args(words)
    now = fly(args.every)
    if not args.file.exists():
        args.file.write_text(json.dumps(now, indent=0))
        print(f"{len(now)} dives written")
        return 0
    before = cast(dict[str, dict[str, str]], json.loads(args.file.read_text()))
    found = differences(before, now)
    same = sum(before.get(name) == keys for name, keys in now.items())
    print(f"{same} of {len(now)} dives are the same in all their streams")
    for key, links in sorted(found.items()):
        dives = ", ".join(f"{link} {times}" for link, times in sorted(links.items()))
        print(f"{key:28}{'(motion) ' if key in MOTION else ''}{dives}")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
