"""`lindy fly NAME`: the topside for one drone of several, and later for another one."""

from dataclasses import replace

from msgspec import structs

from services.runtime.bus.network import open_network
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.choices import DEFAULT, HERE, Choices, Grouped, Insecure, KeysFolder, Router
from tools.fleet.flown_topside import with_pilots_alone
from tools.fleet.look import PATIENCE_S, is_there, who_is_there
from tools.fleet.names import missing
from tools.fleet.successive_topsides import fly_one_after_the_other
from tools.keys.credentials import credentials
from tools.live.cockpit import COCKPIT, announce
from tools.live.dive_folder import out_folder
from tools.start import Planned
from tools.up import topside


def fly(
    drone: str,
    *,
    router: Router = HERE,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    choices: Choices = DEFAULT,
) -> int:
    """Start the topside for one of several drones.

    DRONE is its name, which `lindy drones` lists. As `lindy up topside --router ENDPOINT --name
    DRONE`, which also waits for the drone; and `lindy ask fly ANOTHER` leaves the drone, which
    holds, and flies another one. Exit status 3: done, but data or a service was lost.

    Example: lindy fly rov2 --router tls/192.168.2.1:7447
    """
    if choices.name not in (None, drone):
        raise LindyError(f"fly {drone} --name {choices.name}: the drone's name is said once")
    checked_name(drone, "fly")
    way = credentials(router, "--router", ("pilot",), keys, insecure=insecure)
    own_keys = None if way is None else way.keys
    if not is_there(drone, router, own_keys):
        raise LindyError(missing(drone, who_is_there(router, own_keys), router))
    plan = topside(replace(choices, name=drone), router, way, grouped=grouped, insecure=insecure)
    plan = plan._replace(here=with_pilots_alone(plan.here))
    if COCKPIT in plan.here:
        announce(plan.stack, browser=False)  # one address for the pages of every drone

    def for_drone(other: str) -> Planned:
        folder = str(out_folder(choices.out, ours=True))
        return plan._replace(stack=structs.replace(plan.stack, name=other, out=folder))

    with open_network(router, PATIENCE_S, keys=own_keys) as network:
        return fly_one_after_the_other(plan, network, for_drone)
