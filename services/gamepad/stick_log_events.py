"""An event of a stick log: one word such as `stop`, `goto depth=3 heading=90`, `follow
inspection_box`, `mode depth_hold`, `fault port dead` or `link profile severe`.
"""

from collections.abc import Callable
from math import isfinite, nan
from typing import Literal, cast, get_args

from messages.link import LinkRequest
from messages.pilot import Course, FlightMode
from messages.simulator import FaultKind, FaultRequest
from services.piloting.pilot_intents import (
    FARTHEST,
    FollowIntent,
    GotoIntent,
    Intent,
    ModeIntent,
    OutputIntent,
    PlaceIntent,
    Press,
    goto,
)
from services.piloting.sticks import Incident

Event = Intent | Incident | Literal["lost"]
Courses = Callable[[str], Course]  # reads the path of a name; ValueError: why it cannot
WORDS: tuple[str, ...] = (*get_args(Press), "lost")
ALLOWED = (
    f"{', '.join(WORDS)}, goto depth=M heading=DEG, goto north=M east=M, follow PATH, mode HOLD, "
    "output NAME 0…1, fault PART KIND [VALUE], link down, link up, link profile NAME, "
    "link set KEY=VALUE"
)
FLIGHT_MODES: tuple[str, ...] = get_args(FlightMode)


def event_of(cell: str, courses: Courses) -> Event | None:
    """What a cell of the column `event` means; nothing when it is empty.

    Raises:
        ValueError: names what was found and what is allowed.
    """
    word, _, rest = cell.partition(" ")
    match word:
        case "goto":
            return _goto(rest)
        case "follow":
            return _follow(rest.strip(), courses)
        case "mode":
            return _mode(rest.strip())
        case "output":
            return _output(rest.split())
        case "fault":
            return fault(rest.split())
        case "link":
            return link(rest.split())
        case _:
            return _one_word(cell)


def _one_word(cell: str) -> Event | None:
    if not cell:
        return None
    if cell not in WORDS:
        raise ValueError(f"event is {short(cell)}, expected one of {ALLOWED}")
    return cast(Event, cell)


def short(text: str) -> str:
    """Quoted for an error, long text shortened."""
    return repr(text if len(text) <= 40 else text[:40] + "…")


def _goto(rest: str) -> GotoIntent | PlaceIntent:
    given: dict[str, float] = {}
    for word in rest.split():
        name, _, text = word.partition("=")
        if name not in ("depth", "heading", "north", "east") or name in given:
            raise ValueError(
                f"goto: found {short(word)}, expected depth=M, heading=DEG or both, or north=M "
                f"and east=M"
            )
        try:
            given[name] = float(text)
        except ValueError:
            raise ValueError(f"goto: {name} is {short(text)}, expected a number") from None
    if "north" in given or "east" in given:
        if given.keys() != {"north", "east"} or not max(map(abs, given.values())) <= FARTHEST:
            raise ValueError(
                f"goto: found {short(rest)}, expected north=M and east=M, each within "
                f"{FARTHEST:g} m, and nothing else"
            )
        return PlaceIntent(given["north"], given["east"])
    return goto(given.get("depth"), given.get("heading"))


def _follow(name: str, courses: Courses) -> FollowIntent:
    """The path is read now, so that a mistake in it is named before the dive."""
    if not name:
        raise ValueError("follow needs a path: a name in deploy/paths or a .toml file")
    try:
        return FollowIntent(courses(name))
    except ValueError as error:
        raise ValueError(f"follow: {error}") from None


def _output(rest: list[str]) -> OutputIntent:
    try:
        name, value = rest[0], float(rest[1]) if rest[1:] else nan
    except (IndexError, ValueError):
        name, value = "", nan
    if len(rest) != 2 or not 0.0 <= value <= 1.0:
        raise ValueError(
            f"output: found {short(' '.join(rest))}, expected a name of the vehicle file and a "
            f"number from 0 to 1"
        )
    return OutputIntent(name, value)


def _mode(hold: str) -> ModeIntent:
    if hold not in FLIGHT_MODES:
        raise ValueError(f"mode: found {short(hold)}, expected one of {', '.join(FLIGHT_MODES)}")
    return ModeIntent(cast(FlightMode, hold))


FAULTS: tuple[str, ...] = get_args(FaultKind)
FAULT_FORM = "fault PART KIND, or fault PART KIND VALUE"
LINK_FORM = "link down, link up, link profile NAME or link set KEY=VALUE …"


def fault(words: list[str]) -> FaultRequest:
    """The words after `fault`. Only the simulator knows which parts there are, and which value a
    kind takes.

    Raises:
        ValueError: names what was found and what is allowed.
    """
    if len(words) not in (2, 3):
        raise ValueError(f"fault: found {' '.join(words)!r}, expected {FAULT_FORM}")
    part, kind, *rest = words
    if kind not in FAULTS:
        raise ValueError(f"fault: KIND is {kind!r}, expected one of {', '.join(FAULTS)}")
    value = _number(rest[0]) if rest else None
    return FaultRequest(stamp_ns=0, id="", part=part, fault=cast(FaultKind, kind), value=value)


def link(words: list[str]) -> LinkRequest:
    """The words after `link`. Only the link's model knows its profiles and keys.

    Raises:
        ValueError: names what was found and what is allowed.
    """
    match words:
        case ["down" | "up" as kind]:
            return LinkRequest(stamp_ns=0, id="", kind=kind)
        case ["profile", name]:
            return LinkRequest(stamp_ns=0, id="", kind="profile", profile=name)
        case ["set", _, *_]:
            return LinkRequest(stamp_ns=0, id="", kind="set", settings=tuple(words[1:]))
        case _:
            raise ValueError(f"link: found {' '.join(words)!r}, expected {LINK_FORM}")


def in_words(incident: Incident) -> str:
    """As in a stick log."""
    if isinstance(incident, FaultRequest):
        value = "" if incident.value is None else f" {incident.value:g}"
        return f"fault {incident.part} {incident.fault}{value}"
    words = ("link", incident.kind, *filter(None, [incident.profile]), *incident.settings)
    return " ".join(words)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise ValueError(f"fault: VALUE is {text!r}, expected a finite number")
    return value
