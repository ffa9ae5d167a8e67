"""The faults, as data: how each begins and ends, on virtual time and in a real dive.

A fault that virtual time cannot show (a disk, a processor, the recorder's own process) is for real
dives alone; one that would harm the computer (its clock), for virtual time alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from messages.link import LinkRequest
from messages.simulator import FaultKind
from services.runtime.hosts.jitter import Jitter
from tools.research.faults.modes import VERTICAL
from tools.research.faults.virtual_dive import VirtualDive


class AnyDive(Protocol):
    """What can be done to a dive, on virtual time and in a real one."""

    def kill(self, name: str) -> None: ...
    def stop(self, name: str) -> None: ...
    def go_on(self, name: str) -> None: ...
    def part(self, part: str, fault: FaultKind, value: float | None = None) -> None: ...
    def link(self, request: LinkRequest) -> None: ...
    def ask(self, **wish: object) -> None: ...


Deed = Callable[[AnyDive], None]
VirtualDeed = Callable[[VirtualDive], None]


def nothing(_: AnyDive) -> None:
    """It ends by itself."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault. Times in seconds."""

    name: str
    cause: str  # the group it belongs to
    lasts: float  # [s] from its beginning to its end
    virtual: VirtualDeed | None = None  # begins it
    virtual_end: VirtualDeed = nothing
    real: Deed | None = None
    real_end: Deed = nothing
    after: float = 4.0  # [s] looked at after its end
    ask_at: float = 0.3  # [s] after its beginning, when the disarm is asked for
    # Which goals apply besides those for every cell.
    lives: bool = True  # the sensors do: a held depth is held
    no_pilot: bool = False  # the drone hears nobody for longer than 0.3 s
    no_control: bool = False  # nobody commands the thrusters for longer than 0.2 s
    back: float | None = None  # [s] after its beginning the pilot is in control again


def both(begin: Deed, end: Deed = nothing) -> dict[str, Deed]:
    """The same on virtual time and in a real dive."""
    return {"virtual": begin, "virtual_end": end, "real": begin, "real_end": end}


ON_BOARD = ("simulator", "estimation", "reference", "control")
PROCESSES = (*ON_BOARD, "tether", "gamepad", "link_monitor", "hub_drone", "hub_topside")
ONLOOKERS = ("recorder", "visualizer")  # in real dives alone
BETWEEN = ("tether", "gamepad", "hub_drone", "hub_topside")  # the pilot and the drone
SILENCES = ("control", "reference", "hub_drone")  # without it control says nothing, or nobody hears
KILL_S, HANG_S = 1.5, 3.0  # [s] goals
STOPS = (0.3, 2.0, 20.0)  # [s]


def _of_process(name: str) -> list[Fault]:
    """It is killed; it is stopped, for less and for more than the supervisor waits."""
    watched = name not in ONLOOKERS
    faults = [
        Fault(
            name=f"kill -9 {name}", cause="process ends", lasts=0.0, after=5.0,
            no_pilot=name in BETWEEN, no_control=name in ("control", "hub_drone"),
            back=KILL_S, real=partial(_kill, name), virtual=partial(_kill, name) if watched else None,
        )
    ]  # fmt: skip
    for seconds in STOPS:
        stop, end = partial(_stop, name), partial(_go_on, name)
        longer = seconds > 1.0
        faults.append(
            Fault(
                name=f"SIGSTOP {name} {seconds:g} s", cause="process hangs", lasts=seconds,
                after=5.0 if seconds < 10.0 else 3.0,
                no_pilot=longer and name in BETWEEN,
                no_control=name in ("control", "hub_drone"),
                back=HANG_S if longer else None,
                virtual=stop if watched else None, virtual_end=end, real=stop, real_end=end,
            )
        )  # fmt: skip
    return faults


def _kill(name: str, dive: AnyDive) -> None:
    dive.kill(name)


def _stop(name: str, dive: AnyDive) -> None:
    dive.stop(name)


def _go_on(name: str, dive: AnyDive) -> None:
    dive.go_on(name)


def _exception(name: str) -> Fault:
    return Fault(
        name=f"exception in {name}", cause="process ends", lasts=0.0, after=5.0, back=KILL_S,
        no_pilot=name in BETWEEN, no_control=name == "control",
        virtual=lambda dive: dive.fail(name),
    )  # fmt: skip


TOO_SLOW_S = 0.1  # [s] ten periods of the chain


def _slow(name: str) -> Fault:
    return Fault(
        name=f"{name} ten times too slow", cause="too slow", lasts=6.0,
        virtual=lambda dive: dive.slow(name, TOO_SLOW_S),
        virtual_end=lambda dive: dive.slow(name, 0.0),
    )  # fmt: skip


def _part(
    part: str, kind: FaultKind, value: float | None = None, *, lives: bool = True, lasts: float = 8.0
) -> Fault:
    words = kind if value is None else f"{kind} {value:g}"
    return Fault(
        name=f"{part.removeprefix('sensor/').lower()} {words}",
        cause="sensor" if part.startswith("sensor/") else "thruster",
        lasts=lasts, lives=lives,
        **both(lambda dive: dive.part(part, kind, value), lambda dive: dive.part(part, "none")),
    )  # fmt: skip


def _cable(seconds: float) -> Fault:
    down = LinkRequest(stamp_ns=0, id="", kind="down")
    up = LinkRequest(stamp_ns=0, id="", kind="up")
    return Fault(
        name=f"cable out {seconds:g} s", cause="link", lasts=seconds, no_pilot=True,
        **both(lambda dive: dive.link(down), lambda dive: dive.link(up)),
    )  # fmt: skip


def _profile(name: str) -> Fault:
    bad = LinkRequest(stamp_ns=0, id="", kind="profile", profile=name)
    good = LinkRequest(stamp_ns=0, id="", kind="profile", profile="tether")
    return Fault(
        name=f"link {name}", cause="link", lasts=8.0,
        **both(lambda dive: dive.link(bad), lambda dive: dive.link(good)),
    )  # fmt: skip


def _forget_on_board(dive: VirtualDive) -> None:
    """The drone's computer starts again; nothing is left of what its services knew."""
    for name in ON_BOARD[1:]:
        dive.kill(name)
        dive.forget(name)


def _busy(dive: VirtualDive) -> None:
    dive.busy(ON_BOARD, Jitter(delay=0.005, stall=0.05, stall_every=0.5))


def _idle(dive: VirtualDive) -> None:
    dive.busy(ON_BOARD, Jitter())


def _older_pilot(dive: VirtualDive) -> None:
    """A gamepad of a version that knew no epochs takes the place of the pilot's."""
    dive.stop("gamepad")
    dive.stranger(source="older")


def _newer_pilot(dive: VirtualDive) -> None:
    dive.leave("stranger")
    dive.go_on("gamepad")


NONE = Fault(name="none", cause="none", lasts=6.0, **both(nothing))
IMU, PRESSURE, FIELD = "sensor/imu", "sensor/pressure", "sensor/magnetometer"
BATTERY = "sensor/battery"

FAULTS: tuple[Fault, ...] = (
    NONE,
    *(fault for name in (*PROCESSES, *ONLOOKERS) for fault in _of_process(name)),
    *(_exception(name) for name in PROCESSES if not name.startswith("hub_")),
    *(_slow(name) for name in PROCESSES if not name.startswith("hub_")),
    Fault(
        name="drone side restarted, memory lost", cause="process ends", lasts=0.0, after=8.0,
        no_control=True, virtual=_forget_on_board,
    ),
    _cable(3.0),
    _cable(30.0),
    _profile("congested"),
    _profile("severe"),
    Fault(
        name="flood of junk topside", cause="stranger", lasts=6.0,
        virtual=lambda dive: dive.junk("topside", 50.0),
        virtual_end=lambda dive: dive.leave("junk"),
    ),
    Fault(
        name="flood of junk on board", cause="stranger", lasts=6.0,
        virtual=lambda dive: dive.junk("drone", 50.0),
        virtual_end=lambda dive: dive.leave("junk"),
    ),
    Fault(
        name="stranger without control", cause="stranger", lasts=6.0,
        virtual=lambda dive: dive.stranger(),
        virtual_end=lambda dive: dive.leave("stranger"),
    ),
    Fault(
        name="pilot of an older version", cause="stranger", lasts=0.9, no_pilot=True,
        virtual=_older_pilot, virtual_end=_newer_pilot,
    ),
    Fault(
        name="second reference", cause="stranger", lasts=8.0,
        virtual=lambda dive: dive.second("reference"),
        virtual_end=lambda dive: dive.leave("reference_2"),
    ),
    Fault(
        name="second control", cause="stranger", lasts=8.0,
        virtual=lambda dive: dive.second("control"),
        virtual_end=lambda dive: dive.leave("control_2"),
    ),
    Fault(name="busy processor", cause="too slow", lasts=8.0, virtual=_busy, virtual_end=_idle),
    _part(IMU, "silent", lives=False),
    _part(IMU, "noisy", 200.0, lives=False),
    _part(IMU, "biased", 0.02, lives=False, lasts=20.0),
    _part(IMU, "biased", 0.2, lives=False, lasts=20.0),
    _part(IMU, "frozen", lives=False),
    _part(IMU, "broken", lives=False),
    _part(PRESSURE, "silent", lives=False),
    _part(PRESSURE, "biased", 20e3, lives=False),
    _part(PRESSURE, "biased", -20e3, lives=False),
    _part(PRESSURE, "frozen", lives=False),
    _part(PRESSURE, "noisy", 20.0, lives=False),
    _part(FIELD, "silent"),
    _part(FIELD, "biased", 20e-6),
    *(
        _part(name, kind, value, lasts=10.0)
        for name in ("port", "lateral", VERTICAL)
        for kind, value in (("dead", None), ("reversed", None), ("weak", 0.5))
    ),
    Fault(
        name="goto 1e5", cause="vehicle", lasts=10.0, **both(lambda d: d.ask(kind="goto", depth=1e5))
    ),
)  # fmt: skip
