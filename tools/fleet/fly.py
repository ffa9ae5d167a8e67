"""`lindy fly NAME`: the topside for one drone of several, and later for another one."""

from dataclasses import replace
from pathlib import Path

from msgspec import structs

from services.runtime.bus.network import open_network
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.choices import Choices
from tools.fleet.flight import with_pilots_alone
from tools.fleet.flights import fly_one_after_the_other
from tools.fleet.look import PATIENCE_S, is_there, who_is_there
from tools.fleet.names import missing
from tools.keys.door import door
from tools.live.cockpit import COCKPIT, announce
from tools.live.dive_folder import out_folder
from tools.up import Planned, planned


def fly(
    name: str,
    choices: Choices,
    *,
    router: str,
    grouped: bool,
    keys: Path | None = None,
    insecure: bool = False,
) -> int:
    """Returns the exit status, as `up`.

    Raises:
        LindyError: no drone of this name is there, or as `up`.
    """
    if choices.name not in (None, name):
        raise LindyError(f"fly {name} --name {choices.name}: the drone's name is said once")
    checked_name(name, "fly")
    way = door(router, "--router", ("pilot",), keys, insecure=insecure)
    own_keys = None if way is None else way.keys
    if not is_there(name, router, own_keys):
        raise LindyError(missing(name, who_is_there(router, own_keys), router))
    plan = planned(
        replace(choices, name=name), router, way, gateway=False, grouped=grouped, insecure=insecure
    )
    plan = plan._replace(here=with_pilots_alone(plan.here))
    if COCKPIT in plan.here:
        announce(plan.stack, browser=False)  # one address for the pages of every drone

    def for_drone(other: str) -> Planned:
        folder = str(out_folder(choices.out, ours=True))
        return plan._replace(stack=structs.replace(plan.stack, name=other, out=folder))

    with open_network(router, PATIENCE_S, keys=own_keys) as network:
        return fly_one_after_the_other(plan, network, for_drone)
