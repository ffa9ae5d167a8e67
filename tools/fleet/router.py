"""`lindy router-config`: the configuration of a Zenoh router between many drones and pilots."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from services.runtime.bus.endpoint import checked_endpoint
from services.runtime.bus.router_config import router_config as config_tree
from services.runtime.bus.router_config import thinned_drones
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.choices import HERE, Insecure, KeysFolder, named
from tools.fresh import write_fresh
from tools.keys.credentials import credentials

HEADING = """\
// A Zenoh router for Lindy, written by `lindy router-config` from its topic table: zenohd -c FILE
// Who is let in is on the router's list when this is written; after a change write a new one.
"""


def router_config(
    *,
    listen: Annotated[
        tuple[str, ...], Parameter(help="endpoint for drones, pilots and routers; repeatable")
    ] = (HERE,),
    connect: Annotated[
        tuple[str, ...], Parameter(help="endpoint of another router; repeatable")
    ] = (),
    thin: Annotated[
        tuple[str, ...],
        Parameter(
            help="network interface with little room, such as wwan0: fast streams are sent there "
            "25 times a second; repeatable",
        ),
    ] = (),
    drone: Annotated[
        tuple[str, ...],
        Parameter(
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
    """Write the configuration of a Zenoh router (zenohd).

    It stands between drones and pilots. From the topic table: who may say and hear what, by the
    router's keys, and how urgent it is.

    Example: lindy router-config --listen tls/0.0.0.0:7447 --out router.json5
    """
    if out is not None and out.suffix != ".json5":
        raise LindyError(f"--out {out}: zenohd reads such a file by its name, *.json5")
    ours = [credentials(each, "--listen", ("router",), keys, insecure=insecure) for each in listen]
    if any(ours) and None in ours:
        raise LindyError(f"--listen {' and '.join(listen)}: all with tls, or none of them")
    for each in connect:
        checked_endpoint(each, "--connect")
    for each in drone:
        checked_name(each, "--drone")
    if thin and not thinned_drones(ours[0], drone):
        raise LindyError(
            f"--thin {thin[0]}: each drone is thinned by its name, and this router's keys let in "
            f"none; add --drone NAME, once for each"
        )
    tree = config_tree(listen, connect, ours[0], thin, drone)
    text = HEADING + json.dumps(tree, indent=2) + "\n"
    if out is None:
        print(text, end="")
        return 0
    write_fresh(out, text.encode())
    rows = len(tree["access_control"]["subjects"])
    whom = "whoever reaches it" if ours[0] is None else f"{rows} roles and drones by their keys"
    print(f"{out}: a router at {' and '.join(listen)}, which lets in {whom}")
    return 0
