"""Verbs that talk to a dive that is going on."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def ask(
    kind: str,
    hold: Annotated[
        str | None,
        Parameter(
            help="mode: manual, depth_hold, heading_hold, stabilised or station_keeping; fly: name "
            "of another drone"
        ),
    ] = None,
    *,
    depth: Annotated[float | None, Parameter(help="goto: [m] positive down")] = None,
    heading: Annotated[
        float | None, Parameter(help="goto: [deg] clockwise from north, shortest way")
    ] = None,
    north: Annotated[
        float | None, Parameter(help="goto: [m], with --east; needs a drone that measures position")
    ] = None,
    east: Annotated[float | None, Parameter(help="goto: [m]")] = None,
    path: Annotated[
        str | None, Parameter(help="follow: a name in deploy/paths, or a TOML file")
    ] = None,
    value: Annotated[float | None, Parameter(help="light: brightness 0 … 1")] = None,
    force: Annotated[
        bool,
        Parameter(negative=(), show_default=False, help="take: from whoever has control"),
    ] = False,
    to: Annotated[
        str | None, Parameter(help="offer: to the pilot of this name only; default: to any")
    ] = None,
    dive: Annotated[
        Path | None, Parameter(help="folder of a dive that is going on; default: the newest")
    ] = None,
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="answer as JSON")
    ] = False,
) -> int:
    """Send a request to a running dive, and print the drone's answer.

    KIND is arm, disarm, stop, light, goto, follow or mode; take, offer or release control; resume
    after a failsafe; fly another drone, where `lindy fly` runs. It is asked in the name of the
    pilot of that dive.

    Example: lindy ask goto --depth 3 --heading 90
    """
    from tools.ask import ask

    return ask(
        kind,
        hold,
        depth=depth,
        heading=heading,
        north=north,
        east=east,
        path=path,
        value=value,
        force=force,
        to=to,
        dive=dive,
        as_json=json,
    )


def fault(
    part: str,
    kind: str,
    *,
    value: Annotated[
        float | None,
        Parameter(help="weak: share of the thrust; noisy: times; biased: sensor's unit"),
    ] = None,
    dive: Annotated[
        Path | None, Parameter(help="folder of a dive that is going on; default: the newest")
    ] = None,
) -> int:
    """Make a part of the simulated vehicle fail during a dive, or repair it.

    PART is a thruster's name, a sensor such as pressure, or all. KIND is none (to repair); dead,
    reversed, weak or stuck (a thruster); silent, frozen, noisy, biased or broken (a sensor); wet
    (leak); low, critical or empty (battery); hot (temperature).

    Example: lindy fault port dead
    """
    from tools.fault import fault

    return fault(part, kind, value, dive)
