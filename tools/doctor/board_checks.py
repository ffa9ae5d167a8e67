"""One line of what was found and how it is printed; what a vehicle file tells by itself; and from
what a board answered to findings. What its parameters may be is decided where it is flown:
services/ardusub/board_check.py."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

from services.ardusub import board_check, telemetry
from services.ardusub.authority import MODES
from services.ardusub.mixing import FRAMES
from services.ardusub.telemetry import ENOUGH
from services.control.allocation import Allocation, require_pilotable
from services.control.laws import Settings as ControlSettings
from services.estimation.settings import Settings as EstimationSettings
from services.estimation.settings import WatchSettings
from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import ARDUPILOT, GROUND_STATION
from services.runtime.config.stack import BODY, Stack
from services.simulator.core import Settings as SimulatorSettings
from tools.doctor.visit import NO_BOARD_NS, BoardVisit, S

Verdict = Literal["ok", "change", "missing"]
VERDICTS: tuple[Verdict, ...] = ("ok", "change", "missing")


class VehicleFinding(NamedTuple):
    verdict: Verdict  # missing: it should be there, and is not
    what: str
    text: str


def fit(findings: Sequence[VehicleFinding]) -> bool:
    return all(finding.verdict == "ok" for finding in findings)


def as_lines(findings: Sequence[VehicleFinding]) -> str:
    """A line for each, and a sum."""
    width = max(len(finding.what) for finding in findings)
    lines = [f"{f.verdict:<8} {f.what:<{width}}  {f.text}" for f in findings]
    counts = Counter(finding.verdict for finding in findings)
    total = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
    return "\n".join([*lines, f"{total}: {'fit' if fit(findings) else 'not fit to be flown'}"])


def as_json(findings: Sequence[VehicleFinding]) -> str:
    found = [finding._asdict() for finding in findings]
    return json.dumps({"fit": fit(findings), "findings": found}, ensure_ascii=False, indent=1)


def of_file(stack: Stack, *, simulated: bool) -> list[VehicleFinding]:
    """Without a board.

    Raises:
        ValueError: not a file that a dive accepts.
    """
    vehicle = stack.section(BODY, Vehicle)
    up, down = vehicle.vertical_thrust
    require_pilotable(vehicle)
    axes = Allocation(vehicle, stack.section("control", ControlSettings).allocation).axes
    found = [
        VehicleFinding("ok", "vehicle file", f"{vehicle.name}, {stack.vehicle_path}"),
        VehicleFinding(
            "ok",
            "thrusters",
            f"{len(vehicle.thruster)}, which drive {', '.join(sorted(axes))}; {up:.0f} N up and "
            f"{down:.0f} N down against {vehicle.net_buoyancy:g} N of buoyancy",
        ),
        VehicleFinding("ok", "control", "stable with these gains behind these thrusters"),
    ]
    return [*found, _pressure_noise(stack)] if simulated else found


def _pressure_noise(stack: Stack) -> VehicleFinding:
    """An estimate must not be surer than its sensor is."""
    expected = stack.section("estimation", EstimationSettings).depth.pressure_std
    made = stack.section("simulator", SimulatorSettings).pressure_std
    text = f"estimation.depth.pressure_std is {expected:g} Pa; the simulated sensor has {made:g} Pa"
    if expected >= made:
        return VehicleFinding("ok", "pressure noise", text)
    return VehicleFinding("change", "pressure noise", f"{text}; allowed: at least that")


STAGES = {0: "dev", 64: "alpha", 128: "beta", 192: "release candidate", 255: "official"}
# Of BATT_FS_*_ACT.
ACTIONS = {0.0: "nothing", 1.0: "a warning", 2.0: "disarm", 3.0: "surface"}
USUAL_FORCE = (9.3, 10.3)  # [m/s²] of an accelerometer at rest
CHANGE: Verdict = "change"
FEW = 10  # times: a frame that was under way when the link was opened, a byte that was lost
MOST = 8  # other systems that are named
GROUPS = {
    "MOT_": "MOT_n_DIRECTION",
    "RC": "RC1 to RC6",
    "RCMAP_": "RCMAP_*",
}  # of many parameters with one rule


def of_board(
    visit: BoardVisit,
    vehicle: Vehicle,
    url: str,
    watch: WatchSettings | None = None,
    trouble: str = "",
) -> list[VehicleFinding]:
    """In the order in which a visit goes; it ends with what the rest depends on.

    Args:
        watch: how long the IMU may say one and the same.
        trouble: why there was no connection.
    """
    found = [_link(visit, url, trouble), *_board(visit, vehicle)]
    return [*found, *_coarse(visit, watch or WatchSettings())]


def _link(visit: BoardVisit, url: str, trouble: str) -> VehicleFinding:
    waited = f"in {NO_BOARD_NS / S:g} s"
    if visit.heartbeat is None and visit.others:
        heard = _systems(visit.others)
        told = f"no heartbeat of system {visit.settings.board} {waited}, only of {heard}; "
        return VehicleFinding("missing", "board", told + "ardusub.board names the board's system")
    if visit.heartbeat is None and visit.noise:
        told = f"what came to {url} {waited} was no MAVLink: is it the speed of the serial port?"
        return VehicleFinding("missing", "board", told)
    if visit.heartbeat is None:
        why = trouble or "is the board on, and is there an endpoint (docs/bluerov2.md, step 3)?"
        return VehicleFinding("missing", "board", f"nothing heard at {url} {waited}: {why}")
    if visit.noise > FEW:
        told = (
            f"{url}: {visit.noise} times what came was no MAVLink, too much, or of another sender"
        )
        return VehicleFinding(CHANGE, "link", told)
    return VehicleFinding("ok", "link", url)


def _board(visit: BoardVisit, vehicle: Vehicle) -> Iterator[VehicleFinding]:
    if visit.heartbeat is None:
        return
    autopilot, kind = visit.heartbeat["autopilot"], visit.heartbeat["type"]
    if autopilot != ARDUPILOT:
        yield VehicleFinding(CHANGE, "autopilot", f"is {autopilot}; allowed: 3 (ArduPilot)")
        return
    if not visit.is_submarine:
        told = f"flies a vehicle of type {kind}; allowed: 12 (a submarine)"
        yield VehicleFinding(CHANGE, "autopilot", told)
        return
    yield from _state(visit)
    if visit.version is None:
        yield VehicleFinding(
            "missing",
            "version",
            "is not answered; a board that obeys only its own ground station (MAV_OPTIONS, bit 0) "
            "answers nobody else",
        )
        return
    yield _version(visit)
    if visit.release < board_check.OLDEST:
        return
    yield from of_parameters(visit, vehicle)
    yield _clock(visit)
    yield from _rates(visit)
    yield from _battery(visit)
    yield _leak(visit)
    yield from _others(visit)


def _state(visit: BoardVisit) -> Iterator[VehicleFinding]:
    assert visit.heartbeat is not None
    mode = int(visit.heartbeat["custom_mode"])
    told = f"in mode {MODES.get(mode, mode)}"
    if visit.armed:
        told = f"the board is armed, {told}: somebody flies it; disarm it"
        yield VehicleFinding(CHANGE, "armed", told)
    else:
        yield VehicleFinding("ok", "armed", f"no, {told}")


def _version(visit: BoardVisit) -> VehicleFinding:
    packed = visit.version or 0
    major, minor = visit.release
    stage = STAGES.get(packed & 0xFF, "")
    told = f"ArduSub {major}.{minor}.{packed >> 8 & 0xFF} {stage}".rstrip()
    if visit.release < board_check.OLDEST:
        return VehicleFinding(CHANGE, "version", f"{told}; allowed: 4.5 and newer")
    return VehicleFinding("ok", "version", told)


def _clock(visit: BoardVisit) -> VehicleFinding:
    if not visit.clock.known:
        return VehicleFinding("missing", "clock", "TIMESYNC is not answered")
    told = f"known to {visit.clock.bound_ns / 1e6:.1f} ms"
    if visit.clock.jumps:
        return VehicleFinding(CHANGE, "clock", f"it jumped {visit.clock.jumps} times; {told}")
    return VehicleFinding("ok", "clock", told)


def _rates(visit: BoardVisit) -> Iterator[VehicleFinding]:
    if visit.armed:
        yield VehicleFinding(CHANGE, "rates", "not asked for while the board is armed")
        return
    for stream in visit.streams.streams:
        name = stream.message
        if name is None:
            yield VehicleFinding("missing", stream.messages[-1], "the board does not give it")
            continue
        rate = visit.rates.get(name, 0.0)
        told = f"{rate:.1f} a second, asked for {stream.hz:g}{_reading(visit, name)}"
        least = ENOUGH * stream.hz - 1 / visit.seconds  # one may just have missed the end
        verdict = "missing" if rate == 0.0 else "ok" if rate >= least else CHANGE
        yield VehicleFinding(verdict, name, told)


def _coarse(visit: BoardVisit, watch: WatchSettings) -> Iterator[VehicleFinding]:
    """RAW_IMU has steps of 1 mg and 1 mrad/s: a quiet sensor repeats itself at rest."""
    longest, allowed = visit.repeated_ns / S, watch.imu_frozen_at_rest or watch.imu_frozen
    if longest > allowed / 2:
        told = f"repeated one value for {longest:.2f} s; after {allowed:g} s at rest it counts as"
        setting = f"estimation.watch.imu_frozen_at_rest to {max(10.0, 5 * longest):.0f}"
        yield VehicleFinding(CHANGE, "IMU", f"{told} broken; set {setting}")


def _reading(visit: BoardVisit, name: str) -> str:
    """What a sensor says, where something can be seen in it."""
    fields = visit.newest.get(name)
    if fields is None:
        return ""
    if name in telemetry.IMU_MESSAGES and (sample := telemetry.imu(name, fields, 0)) is not None:
        force = sum(part**2 for part in sample.specific_force) ** 0.5
        at_rest = "" if USUAL_FORCE[0] < force < USUAL_FORCE[1] else ", expected 9.8 at rest"
        return f"; {force:.2f} m/s²{at_rest}"
    if name == telemetry.PRESSURE_MESSAGE:
        return f"; {fields['press_abs']:.0f} hPa"
    return ""


def _battery(visit: BoardVisit) -> Iterator[VehicleFinding]:
    fields = visit.newest.get(telemetry.BATTERY_MESSAGE)
    sample = None if fields is None else telemetry.BatteryMeter().sample(fields, 0)
    if sample is not None:
        ampere = "no current" if sample.current is None else f"{sample.current:.1f} A"
        told = f"{sample.voltage:.1f} V, {ampere}"
        yield VehicleFinding("ok", "battery", told)
    elif fields is not None:
        monitor = visit.optional.values.get("BATT_MONITOR")
        told = "" if monitor is None else f": BATT_MONITOR is {monitor:g}"
        yield VehicleFinding("missing", "battery", f"the board measures no voltage{told}")
    for name in ("BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"):
        if name in visit.optional.values:
            action = visit.optional.values[name]
            yield VehicleFinding(
                "ok", name, f"{number(action)} ({ACTIONS.get(action, 'another one')})"
            )


def _leak(visit: BoardVisit) -> VehicleFinding:
    if visit.leak:
        return VehicleFinding(CHANGE, "leak", "the board says that it has water inside")
    return VehicleFinding(
        "ok",
        "leak",
        f"none said in {visit.seconds:g} s; the board says it every 20 s, from 20 s after its "
        "start, so that --seconds 25 is sure to hear it",
    )


def _others(visit: BoardVisit) -> Iterator[VehicleFinding]:
    """Whoever speaks as Lindy would is one too many; other ground stations are only told."""
    own, board = visit.settings.system, visit.settings.board
    ours = [who for who in visit.others if who[0] == own]
    stations = [
        who
        for who, kind in visit.others.items()
        if kind == GROUND_STATION and who[0] not in (own, board)
    ]
    if ours:
        told = (
            f"{_systems(ours)} speaks as Lindy would, and the board would obey the sticks of both; "
            "give one of the two another system (docs/bluerov2.md, step 4)"
        )
        yield VehicleFinding(CHANGE, "other system", told)
    if stations:
        yield VehicleFinding("ok", "ground station", f"{_systems(stations)}; Lindy is {own}")


def _systems(who: Iterable[tuple[int, int]]) -> str:
    return ", ".join(f"system {s} component {c}" for s, c in sorted(who)[:MOST])


def of_parameters(visit: BoardVisit, vehicle: Vehicle) -> Iterator[VehicleFinding]:
    """Each that is wrong, and one line for each rule that holds."""
    values, release = visit.reader.values, visit.release
    absent = [name for name in visit.reader.wanted if name not in values]
    for name in absent:
        yield VehicleFinding("missing", name, "is not answered")
    if absent:
        return
    wrong = board_check.problems(values, release, visit.settings, vehicle)
    wrong += board_check.moved_motors(values, visit.servos)
    advised = board_check.advice({**visit.optional.values, **values})
    yield from _named(CHANGE, wrong)
    told_of = {sentence.split(" ")[0] for sentence in (*wrong, *advised)}
    groups: dict[str, list[str]] = {}
    for name in (*visit.reader.wanted, *filter(values.__contains__, visit.reader.optional)):
        many = next((group for start, group in GROUPS.items() if _is_of(name, start)), name)
        groups.setdefault(many, []).append(name)
    for group, names in groups.items():
        if told_of.intersection(names):
            continue
        told = f"all {len(names)} fit" if len(names) > 1 else number(values[group])
        if group == "FRAME_CONFIG":
            told += f" ({FRAMES[int(values[group])].name})"
        yield VehicleFinding("ok", group, told)
    yield from _named("ok", advised)


def _named(verdict: Verdict, sentences: Iterable[str]) -> Iterator[VehicleFinding]:
    """Each begins with the parameter's name."""
    for sentence in sentences:
        name, _, told = sentence.partition(" ")
        yield VehicleFinding(verdict, name, told)


def number(value: float) -> str:
    """Whole ones with all their digits: some are sums of bits."""
    return f"{value:.0f}" if value.is_integer() else f"{value:g}"


def _is_of(name: str, start: str) -> bool:
    return name.startswith(start) and name.endswith(
        ("_DIRECTION", "_MIN", "_TRIM", "_MAX", "_REVERSED")
    )
