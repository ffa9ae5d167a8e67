"""The faults, as data.

A fault that virtual time cannot show (a disk, a processor, the recorder's own process) is for real
dives alone; one that real processes cannot have on demand (an exception), for virtual time alone.
"""

from functools import partial

from messages.link import LinkRequest
from messages.simulator import FaultKind
from tests.support.faults.fault import HANGS, AnyDive, Deeds, FaultCase, VirtualDeeds, nothing
from tests.support.faults.modes import VERTICAL
from tests.support.faults.virtual_dive import VirtualDive
from tests.support.jitter import Jitter

ON_BOARD = ("simulator", "estimation", "reference", "control")
PROCESSES = (*ON_BOARD, "tether", "gamepad", "link_monitor", "hub_drone", "hub_topside")
ONLOOKERS = ("recorder", "visualizer")  # in real dives alone
# Between the pilot and the reference. Without its hub the drone hears nobody either, but
# then nobody hears when it notices.
BETWEEN = ("tether", "gamepad", "hub_topside")
DEAF = ("simulator", "hub_drone")  # without it no sample arrives
KILL_S, HANG_S, RESUME_S = 1.5, 3.0, 2.0  # [s] goals
STOPS = (0.3, 2.0, 20.0)  # [s]


def _of_process(name: str) -> list[FaultCase]:
    """It is killed; it is stopped, for less and for more than the supervisor waits."""
    killed = Deeds(partial(_kill, name))
    faults = [
        FaultCase(
            name=f"kill -9 {name}",
            cause="process ends",
            lasts=0.0,
            after=3.5,
            both=None if name in ONLOOKERS else killed,
            only_real=killed,
            lives=name not in DEAF,
            no_control=name == "control",
            back=KILL_S,
        )
    ]
    for seconds in STOPS:
        stopped = Deeds(partial(_stop, name), partial(_go_on, name))
        longer = seconds > 1.0
        faults.append(
            FaultCase(
                name=f"SIGSTOP {name} {seconds:g} s",
                cause=HANGS,
                lasts=seconds,
                after=3.0 if seconds < 10.0 else 2.0,
                both=None if name in ONLOOKERS else stopped,
                only_real=stopped,
                lives=name not in DEAF,
                no_pilot=longer and name in BETWEEN,
                no_control=name == "control",
                back=HANG_S if longer else None,
            )
        )
    return faults


def _kill(name: str, dive: AnyDive) -> None:
    dive.kill(name)


def _stop(name: str, dive: AnyDive) -> None:
    dive.stop(name)


def _go_on(name: str, dive: AnyDive) -> None:
    dive.go_on(name)


def _exception(name: str) -> FaultCase:
    return FaultCase(
        name=f"exception in {name}",
        cause="process ends",
        lasts=0.0,
        after=3.5,
        back=KILL_S,
        lives=name not in DEAF,
        no_control=name == "control",
        only_virtual=VirtualDeeds(lambda dive: dive.fail(name)),
    )


TOO_SLOW_S = 0.1  # [s] ten periods of the chain


def _slow(name: str) -> FaultCase:
    return FaultCase(
        name=f"{name} ten times too slow",
        cause="too slow",
        lasts=5.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.slow(name, TOO_SLOW_S), lambda dive: dive.slow(name, 0.0)
        ),
    )


def _part(
    part: str,
    kind: FaultKind,
    value: float | None = None,
    *,
    lives: bool = True,
    lasts: float = 6.0,
    acts: bool = False,
) -> FaultCase:
    """`acts`: the drone acts by itself until the pilot resumes."""
    words = kind if value is None else f"{kind} {value:g}"
    return FaultCase(
        name=f"{part.removeprefix('sensor/').lower()} {words}",
        cause="sensor" if part.startswith("sensor/") else "thruster",
        lasts=lasts,
        lives=lives,
        back=lasts + RESUME_S if acts else None,
        both=Deeds(lambda dive: dive.part(part, kind, value), lambda dive: dive.part(part, "none")),
    )


def _cable(seconds: float) -> FaultCase:
    down = LinkRequest(stamp_ns=0, id="", kind="down")
    up = LinkRequest(stamp_ns=0, id="", kind="up")
    return FaultCase(
        name=f"cable out {seconds:g} s",
        cause="link",
        lasts=seconds,
        no_pilot=True,
        back=seconds + RESUME_S,
        both=Deeds(lambda dive: dive.link(down), lambda dive: dive.link(up)),
    )


def _profile(name: str) -> FaultCase:
    bad = LinkRequest(stamp_ns=0, id="", kind="profile", profile=name)
    good = LinkRequest(stamp_ns=0, id="", kind="profile", profile="tether")
    return FaultCase(
        name=f"link {name}",
        cause="link",
        lasts=6.0,
        both=Deeds(lambda dive: dive.link(bad), lambda dive: dive.link(good)),
    )


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
    dive.hush("gamepad")
    dive.stranger(source="older")


def _newer_pilot(dive: VirtualDive) -> None:
    dive.leave("stranger")
    dive.speak("gamepad")


def _silent_pilot(dive: VirtualDive) -> None:
    dive.hush("gamepad")


def _stick_down(dive: VirtualDive) -> None:
    """The pilot pushes the stick down, whatever the script says."""
    dive.hush("gamepad")
    dive.sticks(heave=1.0)


def _script_again(dive: VirtualDive) -> None:
    dive.leave("sticks")
    dive.speak("gamepad")


NONE = FaultCase(name="none", cause="none", lasts=6.0, both=Deeds(nothing))
IMU, PRESSURE, FIELD = "sensor/imu", "sensor/pressure", "sensor/magnetometer"

OF_THRUSTERS: tuple[tuple[FaultKind, float | None], ...] = (
    ("dead", None),
    ("reversed", None),
    ("weak", 0.5),
)
FAULTS: tuple[FaultCase, ...] = (
    NONE,
    *(fault for name in (*PROCESSES, *ONLOOKERS) for fault in _of_process(name)),
    *(_exception(name) for name in PROCESSES if not name.startswith("hub_")),
    *(_slow(name) for name in PROCESSES if not name.startswith("hub_")),
    FaultCase(
        name="drone side restarted, memory lost",
        cause="process ends",
        lasts=0.0,
        after=8.0,
        no_control=True,
        only_virtual=VirtualDeeds(_forget_on_board),
    ),
    _cable(3.0),
    _cable(30.0),
    _profile("congested"),
    _profile("severe"),
    FaultCase(
        name="flood of junk topside",
        cause="stranger",
        lasts=6.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.junk("topside", 50.0), lambda dive: dive.leave("junk")
        ),
    ),
    FaultCase(
        name="flood of junk on board",
        cause="stranger",
        lasts=6.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.junk("drone", 50.0), lambda dive: dive.leave("junk")
        ),
    ),
    FaultCase(
        name="stranger without control",
        cause="stranger",
        lasts=6.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.stranger(), lambda dive: dive.leave("stranger")
        ),
    ),
    FaultCase(
        name="pilot of an older version",
        cause="stranger",
        lasts=0.9,
        no_pilot=True,
        only_virtual=VirtualDeeds(_older_pilot, _newer_pilot),
    ),
    FaultCase(
        name="second reference",
        cause="stranger",
        lasts=6.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.second("reference"), lambda dive: dive.leave("reference_2")
        ),
    ),
    FaultCase(
        name="second control",
        cause="stranger",
        lasts=6.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.second("control"), lambda dive: dive.leave("control_2")
        ),
    ),
    FaultCase(
        name="another Lindy on board",
        cause="stranger",
        lasts=6.0,
        after=2.0,
        only_virtual=VirtualDeeds(
            lambda dive: dive.other_lindy(), lambda dive: dive.leave("other")
        ),
    ),
    FaultCase(
        name="pilot silent 22 s",
        cause="link",
        lasts=22.0,
        no_pilot=True,
        back=22.0 + RESUME_S,
        only_virtual=VirtualDeeds(_silent_pilot, _script_again),
    ),
    FaultCase(
        name="busy processor", cause="too slow", lasts=8.0, only_virtual=VirtualDeeds(_busy, _idle)
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
        _part(name, kind, value, lasts=8.0)
        for name in ("port", "lateral", VERTICAL)
        for kind, value in OF_THRUSTERS
    ),
    _part("sensor/leak", "wet", lasts=24.0, acts=True),
    _part("sensor/battery", "low"),
    _part("sensor/battery", "critical", lasts=24.0, acts=True),
    _part("sensor/battery", "empty", lasts=24.0, acts=True),
    _part("sensor/temperature", "hot"),
    FaultCase(
        name="stick down to the depth limit",
        cause="vehicle",
        lasts=20.0,
        only_virtual=VirtualDeeds(_stick_down, _script_again),
    ),
    FaultCase(
        name="goto below the depth limit",
        cause="vehicle",
        lasts=6.0,
        only_virtual=VirtualDeeds(lambda dive: dive.ask(kind="goto", depth=20.0)),
    ),
    FaultCase(
        name="goto 1e5",
        cause="vehicle",
        lasts=10.0,
        both=Deeds(lambda d: d.ask(kind="goto", depth=1e5)),
    ),
)
