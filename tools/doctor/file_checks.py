"""One line of what was found and how it is printed, and what a vehicle file tells by itself."""

import json
from collections import Counter
from collections.abc import Sequence
from typing import Literal, NamedTuple

from services.control.allocation import Allocation, require_pilotable
from services.control.settings import Settings as ControlSettings
from services.estimation.settings import Settings as EstimationSettings
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import BODY, Stack
from services.simulator.core import Settings as SimulatorSettings

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
