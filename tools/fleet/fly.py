"""`lindy fly NAME`: the topside for one drone of several."""

from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.choices import (
    HERE,
    Choices,
    DiveFolder,
    Grouped,
    Insecure,
    KeysFolder,
    Overrides,
    PilotName,
    Router,
    StackName,
    VehicleName,
)
from tools.fleet.look import who_is_there
from tools.fleet.meeting import missing
from tools.keys.credentials import credentials
from tools.live.cockpit import COCKPIT, announce
from tools.start import fly_planned
from tools.up import topside


def fly(
    drone: str,
    /,
    *,
    router: Router = HERE,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    pilot: PilotName = None,
    vehicle: VehicleName = "pioneer",
    stack: StackName = "simulated",
    out: DiveFolder = None,
    set_: Overrides = (),
) -> int:
    """Start the topside for one of several drones.

    `lindy drones` lists the names. `lindy up topside --router ENDPOINT --name DRONE` does the same,
    and also waits for the drone. Exit status 3: data was lost, or a service did not work for a
    while.

    Example: lindy fly rov2 --router tls/192.168.2.1:7447
    """
    checked_name(drone, "fly")
    way = credentials(router, "--router", ("pilot",), keys, insecure=insecure)
    own_keys = None if way is None else way.keys
    if drone not in (there := who_is_there(router, own_keys)):
        raise LindyError(missing(drone, there, router))
    choices = Choices(pilot=pilot, vehicle=vehicle, name=drone, stack=stack, out=out, set_=set_)
    plan, pilot_choice = topside(choices, router, way, grouped=grouped, insecure=insecure)
    if COCKPIT in plan.services:
        announce(plan.stack, browser=False)
    return fly_planned(plan, pilot_choice)
