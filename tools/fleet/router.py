"""`lindy router-config`: the configuration of a Zenoh router between many drones and pilots."""

import json
from collections.abc import Sequence
from pathlib import Path

from services.runtime.bus.endpoint import checked_endpoint
from services.runtime.bus.router_config import router_config, thinned_drones
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.fresh import write_fresh
from tools.keys.door import door

HEADING = """\
// A Zenoh router for Lindy, written by `lindy router-config` from its topic table: zenohd -c FILE
// Who is let in is on the router's list when this is written; after a change write a new one.
"""


def write_router_config(
    listen: Sequence[str],
    connect: Sequence[str],
    out: Path | None,
    *,
    thin: Sequence[str] = (),
    drones: Sequence[str] = (),
    keys: Path | None = None,
    insecure: bool = False,
) -> int:
    """Print the configuration, or write it to a new file.

    Raises:
        LindyError: not an endpoint, it needs keys and has none, nobody knows which drones to thin,
            or the file is there already.
    """
    if out is not None and out.suffix != ".json5":
        raise LindyError(f"--out {out}: zenohd reads such a file by its name, *.json5")
    doors = [door(each, "--listen", ("router",), keys, insecure=insecure) for each in listen]
    if any(doors) and None in doors:
        raise LindyError(f"--listen {' and '.join(listen)}: all with tls, or none of them")
    for each in connect:
        checked_endpoint(each, "--connect")
    for each in drones:
        checked_name(each, "--drone")
    if thin and not thinned_drones(doors[0], drones):
        raise LindyError(
            f"--thin {thin[0]}: each drone is thinned by its name, and this router's keys let in "
            f"none; add --drone NAME, once for each"
        )
    tree = router_config(listen, connect, doors[0], thin, drones)
    text = HEADING + json.dumps(tree, indent=2) + "\n"
    if out is None:
        print(text, end="")
        return 0
    write_fresh(out, text.encode())
    rows = len(tree["access_control"]["subjects"])
    whom = "whoever reaches it" if doors[0] is None else f"{rows} roles and drones by their keys"
    print(f"{out}: a router at {' and '.join(listen)}, which lets in {whom}")
    return 0
