"""The faults, and the modes in which they happen, as data: how each begins and ends, and which
goals apply to it. What virtual time cannot show (a disk, a processor, the recorder's own process):
tests/system/test_dive.py and test_recording_survives.py."""

from collections.abc import Callable
from dataclasses import dataclass
from operator import methodcaller
from typing import Any, NamedTuple

from messages.link import LinkRequest
from messages.simulator import FaultKind
from tests.support.hindered_host import Jitter

# The modes: a vehicle, and what its pilot does before and meanwhile.


HEADING = "t,surge,sway,heave,yaw,tilt,event"


class FlownMode(NamedTuple):
    """Times are seconds after the pilot has taken the sticks."""

    name: str
    vehicle: str
    rows: tuple[str, ...]  # of the stick log, the last one lasting
    settled: float  # [s] then a fault begins
    holds_depth: bool = True
    vertical: str = "vertical"  # name of a vertical thruster
    depth_limit: float = 6.0  # [m] of the failsafe, within reach of the sticks
    lasts: float = 7200.0  # [s] until its last row

    @property
    def script(self) -> str:
        return "\n".join([HEADING, *self.rows, f"{self.lasts:.0f},0,0,0,0,,", ""])


# Two metres down with the stick, then rest; a stick that stays deflected shows a lost pilot.
DOWN = ("0,0,0,0,0,,", "0.5,0,0,1,0,,", "5,0,0,0,0,,")
DEEPER = ("0,0,0,0,0,,", "0.5,0,0,1,0,,", "17,0,0,0,0,,")
VERTICAL = "VERTICAL"  # of a fault: stands for the vehicle's
MODES = (
    FlownMode("manual", "pioneer", (*DOWN, "7,0.3,0,0,0,,mode manual"), 10.0, holds_depth=False),
    FlownMode("depth_hold", "pioneer", (*DOWN, "7,0.3,0,0,0,,mode depth_hold"), 10.0),
    FlownMode("stabilised", "pioneer", (*DOWN, "7,0.3,0,0,0,,"), 10.0),
    FlownMode(
        "station_keeping",
        "minerva",
        (*DOWN, "8,0,0,0,0,,mode station_keeping"),
        16.0,
        vertical="vertical_port",
        depth_limit=4.0,
    ),
    FlownMode(
        "follow",
        "minerva",
        (*DOWN, "8,0,0,0,0,,follow inspection_box"),
        16.0,
        vertical="vertical_port",
        depth_limit=4.0,
    ),
    FlownMode(
        "surfacing",
        "pioneer",
        (*DEEPER, "19,0,0,0,0,,goto depth=0.5"),
        21.0,
        depth_limit=11.0,
    ),
)


# The faults.


Deed = Callable[[Any], object]  # to a dive
HANGS = "process hangs"  # a cause
HANGS_S = 3.0  # [s]
ON_BOARD = ("simulator", "estimation", "reference", "control")
PROCESSES = (*ON_BOARD, "tether", "gamepad", "link_monitor", "hub_drone", "hub_topside")
SERVICES = tuple(name for name in PROCESSES if not name.startswith("hub_"))
# Between the pilot and the reference. Without its hub the drone hears nobody either, but
# then nobody hears when it notices.
BETWEEN = ("tether", "gamepad", "hub_topside")
DEAF = ("simulator", "hub_drone")  # without it no sample arrives
KILL_S, HANG_S, RESUME_S = 1.5, 3.0, 2.0  # [s] goals
STOPS = (0.3, 2.0, 20.0)  # [s]
TOO_SLOW_S = 0.1  # [s] ten periods of the chain


def nothing(_: object) -> None:
    """It ends by itself."""


@dataclass(frozen=True, kw_only=True)
class FaultCase:
    """One fault. Times in seconds."""

    name: str
    cause: str  # the group it belongs to
    begin: Deed
    end: Deed = nothing
    lasts: float = 6.0  # [s] from its beginning to its end
    after: float = 3.0  # [s] looked at after its end
    ask_at: float = 0.3  # [s] after its beginning, when the disarm is asked for
    # Which goals apply besides those for every cell.
    lives: bool = True  # the sensors do: a held depth is held
    no_pilot: bool = False  # the drone hears nobody for longer than 0.3 s
    no_control: bool = False  # nobody commands the thrusters for longer than 0.2 s
    back: float | None = None  # [s] after its beginning the pilot is in control again

    @property
    def flown(self) -> float:
        """[s] How long it is looked at before its end. The supervisor ends what hangs for longer
        than a second: the rest of twenty seconds shows nothing more."""
        return min(self.lasts, HANGS_S) if self.cause == HANGS else self.lasts


def _killed(name: str, words: str, deed: str) -> FaultCase:
    return FaultCase(
        name=f"{words} {name}", cause="process ends", begin=methodcaller(deed, name),
        lasts=0.0, after=3.5, back=KILL_S, lives=name not in DEAF, no_control=name == "control",
    )  # fmt: skip


def _stopped(name: str, seconds: float) -> FaultCase:
    """For less and for more than the supervisor waits."""
    longer = seconds > 1.0
    return FaultCase(
        name=f"SIGSTOP {name} {seconds:g} s", cause=HANGS, begin=methodcaller("stop", name),
        end=methodcaller("go_on", name), lasts=seconds, after=3.0 if seconds < 10.0 else 2.0,
        lives=name not in DEAF, no_pilot=longer and name in BETWEEN, no_control=name == "control",
        back=HANG_S if longer else None,
    )  # fmt: skip


def _slow(name: str) -> FaultCase:
    return FaultCase(
        name=f"{name} ten times too slow", cause="too slow", lasts=5.0, after=2.0,
        begin=lambda dive: dive.hindrances[name].slow(TOO_SLOW_S),
        end=lambda dive: dive.hindrances[name].slow(0.0),
    )  # fmt: skip


def _part(
    part: str, kind: FaultKind, value: float | None = None, *, lives: bool = True,
    lasts: float = 6.0, acts: bool = False,
) -> FaultCase:  # fmt: skip
    """`acts`: the drone acts by itself until the pilot resumes."""
    words = kind if value is None else f"{kind} {value:g}"
    return FaultCase(
        name=f"{part.removeprefix('sensor/').lower()} {words}",
        cause="sensor" if part.startswith("sensor/") else "thruster",
        begin=methodcaller("part", part, kind, value), end=methodcaller("part", part, "none"),
        lasts=lasts, lives=lives, back=lasts + RESUME_S if acts else None,
    )  # fmt: skip


def _link(
    name: str, bad: LinkRequest, good: LinkRequest, seconds: float, **goals: Any
) -> FaultCase:
    begin, end = methodcaller("link", bad), methodcaller("link", good)
    return FaultCase(name=name, cause="link", begin=begin, end=end, lasts=seconds, **goals)


def _cable(seconds: float) -> FaultCase:
    down, up = (LinkRequest(stamp_ns=0, id="", kind=kind) for kind in ("down", "up"))
    back = seconds + RESUME_S
    return _link(f"cable out {seconds:g} s", down, up, seconds, no_pilot=True, back=back)


def _profile(name: str) -> FaultCase:
    bad, good = (
        LinkRequest(stamp_ns=0, id="", kind="profile", profile=each) for each in (name, "tether")
    )
    return _link(f"link {name}", bad, good, 6.0)


def _stranger(name: str, begin: Deed, who: str) -> FaultCase:
    return FaultCase(
        name=name, cause="stranger", begin=begin, end=methodcaller("leave", who), after=2.0
    )


def _forget_on_board(dive: Any) -> None:
    """The drone's computer starts again; nothing is left of what its services knew."""
    for name in ON_BOARD[1:]:
        dive.kill(name)
        dive.host.forget(name)


def _share(jitter: Jitter) -> Deed:
    """How much of a busy processor those on board have."""

    def share(dive: Any) -> None:
        for name in ON_BOARD:
            dive.hindrances[name].share(jitter)

    return share


def _silent(dive: Any) -> None:
    """The pilot's process says nothing, and nobody notices that it hangs."""
    dive.hindrances["gamepad"].stop()


def _speaks(dive: Any) -> None:
    dive.hindrances["gamepad"].go_on()


def _another_pilot(deed: Deed) -> tuple[Deed, Deed]:
    """Somebody takes the place of the pilot's process, and gives it back."""

    def come(dive: Any) -> None:
        _silent(dive)
        deed(dive)

    def go(dive: Any) -> None:
        dive.leave("stranger")
        dive.leave("sticks")
        _speaks(dive)

    return come, go


OLDER = _another_pilot(methodcaller("stranger", source="older"))  # a version that knew no epochs
STICK_DOWN = _another_pilot(methodcaller("sticks", heave=1.0))  # whatever the script says
NONE = FaultCase(name="none", cause="none", begin=nothing)
IMU, PRESSURE, FIELD = "sensor/imu", "sensor/pressure", "sensor/magnetometer"
FAULTS: tuple[FaultCase, ...] = (
    NONE,
    *(
        fault
        for name in PROCESSES
        for fault in (
            _killed(name, "kill -9", "kill"), *(_stopped(name, seconds) for seconds in STOPS)
        )
    ),
    *(_killed(name, "exception in", "fail") for name in SERVICES),
    *(_slow(name) for name in SERVICES),
    FaultCase(
        name="drone side restarted, memory lost", cause="process ends", lasts=0.0, after=8.0,
        no_control=True, begin=_forget_on_board,
    ),
    _cable(3.0),
    _cable(30.0),
    _profile("congested"),
    _profile("severe"),
    _stranger("flood of junk topside", methodcaller("junk", "topside", 50.0), "junk"),
    _stranger("flood of junk on board", methodcaller("junk", "drone", 50.0), "junk"),
    _stranger("stranger without control", methodcaller("stranger"), "stranger"),
    FaultCase(
        name="pilot of an older version", cause="stranger", lasts=0.9, no_pilot=True,
        begin=OLDER[0], end=OLDER[1],
    ),
    _stranger("second reference", methodcaller("second", "reference"), "reference_2"),
    _stranger("second control", methodcaller("second", "control"), "control_2"),
    _stranger("another Lindy on board", methodcaller("other_lindy"), "other"),
    FaultCase(
        name="pilot silent 22 s", cause="link", lasts=22.0, no_pilot=True, back=22.0 + RESUME_S,
        begin=_silent, end=_speaks,
    ),
    FaultCase(
        name="busy processor", cause="too slow", lasts=8.0, end=_share(Jitter()),
        begin=_share(Jitter(delay=0.005, stall=0.05, stall_every=0.5)),
    ),
    _part(IMU, "silent", lives=False),
    _part(IMU, "noisy", 200.0, lives=False),
    _part(IMU, "biased", 0.02, lives=False, lasts=15.0),
    _part(IMU, "biased", 0.2, lives=False, lasts=15.0),
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
        fault
        for name in ("port", "lateral", VERTICAL)
        for fault in (
            _part(name, "dead", lasts=8.0),
            _part(name, "reversed", lasts=8.0),
            _part(name, "weak", 0.5, lasts=8.0),
        )
    ),
    _part("sensor/leak", "wet", lasts=24.0, acts=True),
    _part("sensor/battery", "low"),
    _part("sensor/battery", "critical", lasts=24.0, acts=True),
    _part("sensor/battery", "empty", lasts=24.0, acts=True),
    _part("sensor/temperature", "hot"),
    FaultCase(
        name="stick down to the depth limit", cause="vehicle", lasts=20.0,
        begin=STICK_DOWN[0], end=STICK_DOWN[1],
    ),
    FaultCase(
        name="goto below the depth limit", cause="vehicle",
        begin=methodcaller("ask", kind="goto", depth=20.0),
    ),
    FaultCase(
        name="goto 1e5", cause="vehicle", lasts=10.0,
        begin=methodcaller("ask", kind="goto", depth=1e5),
    ),
)  # fmt: skip
