"""`lindy ask`: sends one request to a running dive, and prints the drone's answer. Other verbs ask
through it."""

import json
import math
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Generic, cast, get_args

import msgspec
from cyclopts import Parameter
from msgspec import UNSET

from messages import topics
from messages.pilot import (
    Course,
    FlightMode,
    PilotAnswer,
    PilotCommand,
    PilotRequest,
    RequestKind,
)
from messages.topic import Topic
from services.gamepad.io.path_file import course_of
from services.piloting.pilot_intents import FARTHEST, goto
from services.reference.guidance.path_following import PlannedPath
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running, running_in
from services.runtime.config.settings import deploy_file, nearest
from services.runtime.launch.process_plan import HOME
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from services.runtime.node.requests import GIVE_UP_NS, A, Q
from tools.choices import Json, RunningDive

OPTIONS: dict[str, tuple[str, ...]] = {
    "arm": (),
    "disarm": (),
    "stop": (),
    "light": ("name",),
    "output": ("name", "setting"),
    "goto": ("depth", "heading", "north", "east"),
    "follow": ("name",),
    "home": (),
    "unwind": (),
    "mode": ("name",),
    "take": ("force",),
    "offer": ("name",),
    "release": (),
    "resume": (),
}  # the options of each kind of request
FLIGHT_MODES: tuple[str, ...] = get_args(FlightMode)
LONGEST_NAME = 128  # [letters] of a `Name`
ABOUT_CONTROL: tuple[RequestKind, ...] = ("lease", "force", "offer", "release")
NO_PILOT = "nobody flies from this side now, so control cannot change hands"
NO_PILOT_NS = 1_000_000_000  # [ns] without a command: there is no pilot on this side


def ask(
    kind: str,
    name: Annotated[
        str | None,
        Parameter(
            help=f"mode: {', '.join(FLIGHT_MODES)}; follow: a name in deploy/paths, or a TOML "
            "file; light: 0 … 1; output: its name in the vehicle file; offer: to the pilot of "
            "this name only"
        ),
    ] = None,
    setting: Annotated[str | None, Parameter(help="output: on, off or 0 … 1")] = None,
    /,
    *,
    depth: Annotated[float | None, Parameter(help="goto: [m] positive down")] = None,
    heading: Annotated[
        float | None, Parameter(help="goto: [deg] clockwise from north, shortest way")
    ] = None,
    north: Annotated[
        float | None, Parameter(help="goto: [m], with --east; needs a drone that measures position")
    ] = None,
    east: Annotated[float | None, Parameter(help="goto: [m]")] = None,
    force: Annotated[bool, Parameter(help="take: from whoever has control")] = False,
    dive: RunningDive = None,
    as_json: Json = False,
) -> int:
    """Send a request to a running dive, and print the answer.

    KIND is arm, disarm, stop, light, output, goto, follow, home (to where it was armed), unwind
    (turn back the tether's whole turns) or mode; take, offer or release control; resume after a
    failsafe. It is asked in the name of the pilot of that dive. Where dives of several drones are
    going on, --dive must name one; a stop without it is for all of them.

    Example: lindy ask goto --depth 3 --heading 90
    """
    given: dict[str, Any] = {
        "name": name,
        "setting": setting,
        "depth": depth,
        "heading": heading,
        "north": north,
        "east": east,
        "force": force or None,
    }
    wanted = wanted_of(kind, **given)
    if wanted.kind == "stop" and dive is None:
        return max(_asked(wanted, running, as_json) for running in dives_here())
    return _asked(wanted, dive_in(dive), as_json)


def _asked(wanted: PilotRequest, running: Running, as_json: bool) -> int:
    kind = "take" if wanted.kind in ("lease", "force") else wanted.kind
    if HOME not in running.endpoints and wanted.kind in ABOUT_CONTROL:
        raise LindyError(f"{kind}: there is no pilot on this side; ask in the topside's folder")
    answer = answer_to(lambda node: for_the_pilot(node, wanted), running, "drone")
    if as_json:
        print(in_json(kind, answer))
    if not answer.accepted:
        raise LindyError(f"{running.vehicle} refuses ({kind}): {answer.reason}")
    if not as_json:
        print(f"{running.vehicle}: {in_words(kind, answer)}")
    return 0


def wanted_of(kind: str, **given: Any) -> PilotRequest:
    """Raises LindyError: an unknown kind, or options that make no sense with it."""
    _check_options(kind, given)
    known = cast(
        RequestKind, kind if kind != "take" else "force" if given.get("force") else "lease"
    )
    match known:
        case "light":
            return _wanted(known, value=_brightness(given["name"]))
        case "output":
            return _output(given["name"], given.get("setting"))
        case "goto" if given.get("north") is not None or given.get("east") is not None:
            return _place(given)
        case "goto":
            try:
                intent = goto(given["depth"], given["heading"])
            except ValueError as error:
                raise LindyError(str(error)) from None
            return _wanted(known, depth=intent.depth, heading=intent.heading)
        case "follow":
            return _wanted(known, course=_course(given["name"]))
        case "mode":
            return _wanted(known, flight_mode=_flight_mode(given["name"]))
        case "offer":
            return _wanted(known, to=_named("offer", given.get("name") or ""))
        case _:
            return _wanted(known)


def dive_in(folder: Path | None) -> Running:
    """The running dive in a folder, or the one that its pilot has left it for; by default the
    newest in this folder or in dives/.

    Raises:
        LindyError: there is none, or there are several, of different drones.
    """
    if folder is not None:
        if (running := running_in(folder)) is None:
            raise LindyError(f"no dive is going on in {folder}; start one with `lindy dive`")
        return running
    drones = dives_here()
    if len(drones) > 1:
        names = ", ".join(sorted(running.vehicle for running in drones))
        raise LindyError(f"dives of {names} are going on here: name the folder of one with --dive")
    return drones[0]


def dives_here() -> list[Running]:
    """The newest running dive of each drone, in this folder or in dives/.

    Raises:
        LindyError: there is none.
    """
    places = [Path(), *Path("dives").glob("*")]
    found = [(place, running) for place in places if (running := running_in(place)) is not None]
    if not found:
        raise LindyError(
            "no dive is going on here or in dives/; name the folder of one with --dive, or "
            "start one with `lindy dive`"
        )
    found.sort(key=lambda each: _written(each[0] / RUNNING))
    return list({running.vehicle: running for _, running in found}.values())


def _written(file: Path) -> float:
    """[s] 0: it has ended meanwhile."""
    with suppress(OSError):
        return file.stat().st_mtime
    return 0.0


class OneRequest(Generic[Q, A]):
    """A request, and its answer. `asked`: it was sent."""

    def __init__(self, node: Node, asks: Topic[Q], answers: Topic[A]) -> None:
        self.answer: A | None = None
        self.given_up = False
        self.asked = False
        self._asking = node.request(
            asks,
            answers,
            on_answer=self._keep,
            on_given_up=self._give_up,
            who=f"{node.name}-{os.getpid()}",
        )
        node.every(1e9 / GIVE_UP_NS, self._look)

    def ask(self, request: Q, now: int) -> None:
        """Send the request; later calls do nothing, because it is repeated automatically."""
        if not self.asked:
            self.asked = True
            self._asking.ask(request, now)

    def _keep(self, _request: Q, answer: A, _now: int) -> None:
        self.answer = answer

    def _look(self, _: int) -> None:
        """Give up if the request could not be sent at all."""
        self.given_up = self.given_up or not self.asked

    def _give_up(self, _request: Q, _now: int) -> None:
        self.given_up = True


def at_once(node: Node, request: Q, asks: Topic[Q], answers: Topic[A]) -> OneRequest[Q, A]:
    """Ask as soon as the node runs."""
    asking = OneRequest(node, asks, answers)
    node.alarm(lambda now: asking.ask(request, now)).set(0)
    return asking


def answer_to(ask: Callable[[Node], OneRequest[Q, A]], running: Running, who: str) -> A:
    """
    Args:
        ask: asks something through the node it is given.
        who: answers, for the error message.

    Raises:
        LindyError: nobody answers.
    """
    side = HOME if HOME in running.endpoints else next(iter(running.endpoints))
    woken = threading.Event()
    with open_bus(running.endpoints[side], running.vehicle) as bus:
        node = Node("ask", {side: bus}, time.monotonic_ns, VolatileCheckpoint(), visitor=True)
        node.wake = woken.set
        asking = ask(node)
        while asking.answer is None and not asking.given_up:
            woken.wait(max(0.0, (node.deadline() - time.monotonic_ns()) / 1e9))
            woken.clear()
            node.step()
    if not asking.asked:
        raise LindyError(f"{NO_PILOT}: open the page, or connect a pad, and ask again")
    if asking.answer is None:
        raise LindyError(f"the {who} does not answer")
    return asking.answer


def for_the_pilot(node: Node, wanted: PilotRequest) -> OneRequest[PilotRequest, PilotAnswer]:
    """Send a request in the name of this side's pilot, as soon as one of its commands is heard. A
    stop is sent at once. Without a pilot on this side, a request about control is not sent, and any
    other one is sent in nobody's name."""
    if wanted.kind == "stop":
        return at_once(node, wanted, topics.PILOT_REQUEST, topics.PILOT_ANSWER)
    asking = OneRequest(node, topics.PILOT_REQUEST, topics.PILOT_ANSWER)

    def in_its_name(command: PilotCommand, now: int) -> None:
        named = msgspec.structs.replace(wanted, source=command.source, epoch=command.epoch)
        asking.ask(named, now)

    if HOME in node.sides:
        node.each(topics.PILOT_COMMAND, in_its_name, onlooker=True)
    if wanted.kind not in ABOUT_CONTROL:
        node.alarm(lambda now: asking.ask(wanted, now)).set(node.now() + NO_PILOT_NS)
    return asking


def in_words(kind: str, answer: PilotAnswer) -> str:
    """The answer to a request that was accepted."""
    stop = answer.stop
    if stop is None:
        return "; ".join(filter(None, (f"{kind}: accepted", answer.note or "")))
    vertical = "up" if stop.depth < 0 else "down"
    turn = "counter-clockwise" if stop.heading < 0 else "clockwise"
    known = isinstance(stop.over_ground, float)
    ground = f"{stop.over_ground:.3f} m over the ground, " if known else ""
    unknown = "" if known else "; how far surge and sway carry it is not known, without a position"
    return (
        f"{kind}: accepted; still goes {ground}{abs(stop.depth):.3f} m {vertical} and "
        f"{abs(math.degrees(stop.heading)):.2f} deg {turn}, at rest after {stop.seconds:.2f} s"
        f"{unknown}"
    )


def in_json(kind: str, answer: PilotAnswer) -> str:
    """Depth + down in m, heading + clockwise in deg."""
    stop = answer.stop and {
        "depth_m": answer.stop.depth,
        "heading_deg": math.degrees(answer.stop.heading),
        "seconds": answer.stop.seconds,
        "over_ground_m": None if answer.stop.over_ground is UNSET else answer.stop.over_ground,
    }
    return json.dumps(
        {
            "id": answer.id,
            "kind": kind,
            "accepted": answer.accepted,
            "reason": answer.reason,
            "note": answer.note or "",
            "stop": stop,
        },
        allow_nan=False,
    )


def _check_options(kind: str, given: dict[str, Any]) -> None:
    """Raises LindyError: an unknown kind, or an option that this kind does not take."""
    if kind not in OPTIONS:
        raise LindyError(f"unknown request {kind!r}{nearest(kind, list(OPTIONS))}")
    for name in given:
        if given[name] is not None and name not in OPTIONS[kind]:
            words = {"name": "second word", "setting": "third word"}
            what = f"{words[name]}, found {given[name]!r}" if name in words else f"--{name}"
            raise LindyError(f"{kind} takes no {what}")


def _wanted(kind: RequestKind, **more: Any) -> PilotRequest:
    """A request that has neither its stamp nor its id yet."""
    return PilotRequest(stamp_ns=0, id="", kind=kind, **more)


def _place(given: dict[str, Any]) -> PilotRequest:
    """Raises LindyError: only one coordinate, a heading as well, or not a number."""
    place = (given.get("north"), given.get("east"))
    if None in place or given["heading"] is not None:
        raise LindyError("goto a place needs --north and --east, and takes no --heading")
    numbers = [x for x in (*place, given["depth"]) if x is not None]
    if not all(abs(x) <= FARTHEST for x in numbers):  # NaN is in no range
        raise LindyError(f"goto: expected numbers of at most {FARTHEST:g} m")
    return _wanted("goto", depth=given["depth"], north=place[0], east=place[1])


def _brightness(word: str | None) -> float:
    with suppress(ValueError):
        if 0.0 <= (value := float(word or "")) <= 1.0:
            return value
    found = f", found {word!r}" if word else ""
    raise LindyError(f"light needs a brightness from 0 to 1, such as light 0.5{found}")


def _output(name: str | None, setting: str | None) -> PilotRequest:
    """Which outputs there are, only the drone knows."""
    if not name or setting is None:
        raise LindyError("output needs its name and on, off or a number: output lasers on")
    try:
        value = {"on": 1.0, "off": 0.0}.get(setting)
        value = float(setting) if value is None else value
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:  # NaN is in no range
        raise LindyError(
            f"output {name}: expected on, off or a number from 0 to 1, found {setting!r}"
        )
    return _wanted("output", output=_named("output", name), value=value)


def _named(kind: str, name: str) -> str:
    if len(name) > LONGEST_NAME:
        raise LindyError(
            f"{kind}: the name has {len(name)} letters, expected at most {LONGEST_NAME}"
        )
    return name


def _flight_mode(name: str | None) -> FlightMode:
    if name is None:
        raise LindyError(f"mode needs its name: {', '.join(FLIGHT_MODES)}")
    if name not in FLIGHT_MODES:
        raise LindyError(f"unknown mode {name!r}{nearest(name, list(FLIGHT_MODES))}")
    return cast(FlightMode, name)


def _course(name: str | None) -> Course:
    if name is None:
        raise LindyError("follow needs a path: a name in deploy/paths, or a TOML file")
    file = deploy_file("paths", name)
    course = course_of(file)
    try:
        PlannedPath(course)  # the drone would refuse it as well, but without the file's name
    except ValueError as error:
        raise LindyError(f"{file}: {error}") from None
    return course
