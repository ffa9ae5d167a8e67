"""Incidents of a stick log: a part of the simulated vehicle fails, or the emulated link changes.

They are the requests of `lindy fault` and `lindy link`, without stamp and id: the sender fills
them in.
"""

from math import isfinite
from typing import cast, get_args

from messages.link import LinkRequest
from messages.simulator import FaultKind, FaultRequest
from services.piloting.sticks import Incident

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
