"""How much code one tick runs through: functions and files called in 10 ms of a dive on virtual
time, the median of a hundred ticks, in all and for each room. `python -m tests.long.tick`;
`--functions ROOM` lists what is called there, with how often in those ticks."""

import sys
from collections import Counter
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from types import CodeType, FrameType

from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost

ROOT = Path(__file__).parents[2]
CHAIN = ("simulator", "estimation", "reference", "control", "tether", "gamepad")
BEGIN_S, TICKS, TICK_NS = 8.0, 100, 10_000_000


def ticks(folder: Path) -> list[Counter[CodeType]]:
    """The functions of the project that each tick calls, and how often."""
    rows = [f"{k / 10},0.{k % 7},0.{k % 3},0.{k % 5},0.{k % 2}" for k in range(100)]
    (folder / "sticks.csv").write_text("\n".join(["t,surge,sway,heave,yaw", *rows]))
    stack = Stack(
        pilot=f"script:{folder / 'sticks.csv'}",
        out=str(folder),
        virtual=True,
        overrides=["estimation.calibration.still_time=1"],
    )
    host, services = VirtualHost(), Registry.read()
    host.add_all(services.only({name: services[name] for name in CHAIN}), stack)
    host.run(round(BEGIN_S * 1e9))
    found: list[Counter[CodeType]] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            found[-1][frame.f_code] += 1

    for _ in range(TICKS):
        found.append(Counter())
        sys.setprofile(note)
        try:
            host.run(host.now + TICK_NS)
        finally:
            sys.setprofile(None)
    return [Counter({c: n for c, n in one.items() if room(c)}) for one in found]


def room(code: CodeType) -> str:
    """`estimation`, `messages` …; empty: not of the project."""
    path = Path(code.co_filename)
    if not path.is_relative_to(ROOT) or ".venv" in path.parts:
        return ""
    parts = path.relative_to(ROOT).parts
    return parts[1] if parts[0] == "services" else parts[0]


def main(arguments: list[str]) -> None:
    with TemporaryDirectory() as folder:
        found = ticks(Path(folder))
    if arguments[:1] == ["--functions"]:
        called = sum((one for one in found), Counter[CodeType]())
        for code, times in sorted(called.items(), key=lambda pair: pair[0].co_filename):
            if room(code) == arguments[1]:
                file = Path(code.co_filename).relative_to(ROOT)
                print(f"{times:6} {file}:{code.co_firstlineno} {code.co_qualname}")
        return
    rooms = sorted({room(code) for one in found for code in one})
    for name in ("all", *rooms):
        own = [[code for code in one if name in ("all", room(code))] for one in found]
        functions = median(len(codes) for codes in own)
        files = median(len({code.co_filename for code in codes}) for codes in own)
        calls = median(
            sum(one[code] for code in codes) for one, codes in zip(found, own, strict=True)
        )
        print(f"{name:14} {functions:5.0f} functions {files:4.0f} files {calls:6.0f} calls")


if __name__ == "__main__":
    main(sys.argv[1:])
