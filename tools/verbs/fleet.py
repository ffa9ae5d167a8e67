"""Verbs for several drones on one network."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tools.choices import Choices, named
from tools.verbs.start import Grouped, Insecure, KeysFolder

Meet = Annotated[
    str,
    Parameter(
        name=("--router", "--connect"),
        help="endpoint of a router, or of a drone, e.g. tls/192.168.2.2:7447",
    ),
]
HERE = "tcp/127.0.0.1:7447"


def fly(
    drone: str,
    *,
    router: Meet = HERE,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    choices: Choices | None = None,
) -> int:
    """Start the topside for the drone of this name, which must be there; `lindy drones` lists them.

    As `lindy up topside --router ENDPOINT --name DRONE`, which also waits for the drone; and
    `lindy ask fly ANOTHER` leaves the drone, which holds, and flies another one.

    Example: lindy fly rov2 --router tls/192.168.2.1:7447
    """
    from tools.fleet.fly import fly

    return fly(
        drone, choices or Choices(), router=router, grouped=grouped, keys=keys, insecure=insecure
    )


def drones(
    *,
    router: Meet = HERE,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    json: Annotated[bool, Parameter(negative=(), show_default=False, help="as JSON")] = False,
) -> int:
    """List the drones that can be reached: name, type, version, mode, battery, who flies.

    Example: lindy drones --router tls/192.168.2.1:7447
    """
    from tools.fleet.drones import drones

    return drones(router, "--router", as_json=json, keys=keys, insecure=insecure)


def fleet(
    *,
    router: Meet = HERE,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="a line of JSON every second")
    ] = False,
    seconds: Annotated[
        float | None, Parameter(show_default=False, help="end after so long; default: Ctrl-C")
    ] = None,
) -> int:
    """Show all drones that can be reached: mode, depth, heading, battery, link, who flies, alarms.

    On a terminal one screen; elsewhere a line for each drone whenever its mode, its pilot or its
    alarms change. `link` is the time since the drone was last heard, and what was lost since.

    Example: lindy fleet --router tls/192.168.2.1:7447
    """
    from tools.fleet.fleet import fleet

    return fleet(router, "--router", json=json, keys=keys, insecure=insecure, seconds=seconds)


def record(
    *,
    router: Meet = HERE,
    out: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="folder for the recordings, one folder each; default: dives/ and the time (UTC)",
        ),
    ] = None,
    drone: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(), show_default=False, help="record this one only; repeatable; default: all"
        ),
    ] = (),
    keys: KeysFolder = None,
    insecure: Insecure = False,
    seconds: Annotated[
        float | None, Parameter(show_default=False, help="end after so long; default: Ctrl-C")
    ] = None,
) -> int:
    """Record every drone that can be reached: all that leaves it but its video, a file for each.

    Each file is a recording like any other, of which `lindy log cut` cuts a dive out. Exit status
    3: something that came is in none of them, a drone was not heard for more than 3 s, a drone of
    --drone was never heard, or, without --drone, none was.

    Example: lindy record --router tls/192.168.2.1:7447 --out dives/class
    """
    from tools.fleet.record import record

    return record(
        router, "--router", out=out, only=drone, keys=keys, insecure=insecure, seconds=seconds
    )


def router_config(
    *,
    listen: Annotated[
        tuple[str, ...],
        Parameter(negative=(), help="endpoint for drones, pilots and routers; repeatable"),
    ] = (HERE,),
    connect: Annotated[
        tuple[str, ...],
        Parameter(negative=(), show_default=False, help="endpoint of another router; repeatable"),
    ] = (),
    thin: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            show_default=False,
            help="network interface with little room, such as wwan0: fast streams are sent there "
            "25 times a second; repeatable",
        ),
    ] = (),
    drone: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            show_default=False,
            help="name of a drone that --thin thins, besides those whom this router's keys let "
            "in; repeatable",
        ),
    ] = (),
    out: Annotated[
        Path | None, Parameter(converter=named, help="a new file, *.json5; default: printed")
    ] = None,
    keys: KeysFolder = None,
    insecure: Insecure = False,
) -> int:
    """Write the configuration of a Zenoh router (zenohd) between drones and pilots.

    From the topic table: who may say and hear what, by the router's keys, and how urgent it is.

    Example: lindy router-config --listen tls/0.0.0.0:7447 --out router.json5
    """
    from tools.fleet.router import write_router_config

    return write_router_config(
        listen, connect, out, thin=thin, drones=drone, keys=keys, insecure=insecure
    )
