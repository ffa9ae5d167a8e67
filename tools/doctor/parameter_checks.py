"""Findings about a board's board_check. What they may be is decided where it is flown:
services/ardusub/board_check.py."""

from collections.abc import Iterator

from services.ardusub import board_check
from services.ardusub.mixing import FRAMES
from services.marine.vehicle import Vehicle
from tools.doctor.finding import VehicleFinding
from tools.doctor.remedies import remedy
from tools.doctor.visit import BoardVisit

GROUPS = {
    "MOT_": "MOT_n_DIRECTION",
    "RC": "RC1 to RC6",
    "RCMAP_": "RCMAP_*",
}  # of many parameters with one rule


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
    new = board_check.is_new(release)
    for sentence in wrong:
        name, _, told = sentence.partition(" ")
        value = remedy(name, values, visit.settings, vehicle, new=new)
        yield VehicleFinding(
            "change", name, told + ("" if value is None else f"; set it to {number(value)}")
        )
    yield from _that_fit(visit, {sentence.split(" ")[0] for sentence in wrong})
    for sentence in _advised(visit):
        name, _, told = sentence.partition(" ")
        yield VehicleFinding("ok", name, told)


def _advised(visit: BoardVisit) -> list[str]:
    return board_check.advice({**visit.optional.values, **visit.reader.values})


def _that_fit(visit: BoardVisit, wrong: set[str]) -> Iterator[VehicleFinding]:
    values = visit.reader.values
    advised = {sentence.split(" ")[0] for sentence in _advised(visit)}
    groups: dict[str, list[str]] = {}
    for name in (*visit.reader.wanted, *filter(values.__contains__, visit.reader.optional)):
        many = next((group for start, group in GROUPS.items() if _is_of(name, start)), name)
        groups.setdefault(many, []).append(name)
    for group, names in groups.items():
        if wrong.intersection(names) or advised.intersection(names):
            continue
        told = f"all {len(names)} fit" if len(names) > 1 else number(values[group])
        if group == "FRAME_CONFIG":
            told += f" ({FRAMES[int(values[group])].name})"
        yield VehicleFinding("ok", group, told)


def number(value: float) -> str:
    """Whole ones with all their digits: some are sums of bits."""
    return f"{value:.0f}" if value.is_integer() else f"{value:g}"


def _is_of(name: str, start: str) -> bool:
    return name.startswith(start) and name.endswith(
        ("_DIRECTION", "_MIN", "_TRIM", "_MAX", "_REVERSED")
    )
