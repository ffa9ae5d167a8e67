"""`lindy run` and `lindy hub`: one process of a stack in the foreground, to start it by hand."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from socket import gethostname

import msgspec

from services.runtime.bus.endpoint import checked_endpoint
from services.runtime.bus.key_files import KeyFiles
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.hosts.process_host import HubLaunch, Launch, run_hub, run_services
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from tools.checks import checked, pilot_of
from tools.choices import Choices
from tools.fleet.names import own_name
from tools.keys.door import door, is_local
from tools.keys.roles import Role
from tools.live.dive_folder import dive_files
from tools.live.viewer import VIEWER
from tools.replay.viewing import one_bus

CALLERS: tuple[Role, ...] = ("observer", "pilot")
FILE = {"recorder": "mcap", "visualizer": "rrd"}  # of one dive only


def run(
    service: str,
    connect: tuple[str, ...],
    choices: Choices,
    keys: Path | None = None,
    *,
    replay: bool = False,
) -> int:
    """Run one service until Ctrl-C. Returns its exit status.

    Args:
        replay: it shows what `lindy replay` plays, and no vehicle.

    Raises:
        LindyError: an unknown service, or a side that is missing or has no endpoint.
    """
    services = Registry.read(choices.stack)
    if service not in services:
        raise LindyError(f"unknown service {service!r}{nearest(service, sorted(services))}")
    spec = services[service]
    if replay:
        spec = of_a_replay(service, spec)
    endpoints = endpoints_of(service, spec, connect)
    stack = checked(choices, pilot_of(choices.pilot or "gamepad"), services, {service})
    out = (choices.out or Path()).resolve()
    if (kind := FILE.get(service)) and (earlier := dive_files(out, kind)):
        raise LindyError(f"{earlier[0]} is there already; choose another --out for the {service}")
    name = stack.name or own_name(stack.vehicle_name, gethostname())
    stack = msgspec.structs.replace(stack, out=str(out), name=name, replay=replay)
    with tempfile.TemporaryDirectory(prefix="lindy-") as checkpoint:
        return run_services(
            Launch(
                process=service,
                services={service: spec},
                stack=stack,
                stack_file=str(services.file),
                endpoints=endpoints,
                checkpoint=checkpoint,
                keys=keys_for(endpoints, keys),
            )
        )


def of_a_replay(service: str, spec: ServiceSpec) -> ServiceSpec:
    """The service with the one bus that a replay has.

    Raises:
        LindyError: it acts, and does not merely show.
    """
    if service != VIEWER:
        raise LindyError(
            f"{service} --replay: a replay is looked at only; allowed is {VIEWER}. To feed a "
            f"recording to {service}: lindy replay FILE --through {service} --diff"
        )
    return one_bus(spec)


def keys_for(endpoints: Mapping[str, str], keys: Path | None) -> KeyFiles | None:
    """The keys for hubs that ask for them; None: none does.

    Raises:
        LindyError: there are none, or they are no good.
    """
    for side, endpoint in endpoints.items():
        if endpoint.startswith("tls/"):
            found = door(endpoint, f"--connect {side} =", CALLERS, keys, insecure=False)
            return None if found is None else found.keys
    return None


def hub(endpoint: str, *, insecure: bool) -> int:
    """Run a side's hub until Ctrl-C. Returns its exit status.

    Raises:
        LindyError: not an endpoint, or other machines could reach it and nobody said they may.
    """
    if not insecure and not is_local(checked_endpoint(endpoint, "endpoint")):
        raise LindyError(
            f"endpoint {endpoint} would let in any machine of the network, because this hub asks "
            f"for no keys; use 127.0.0.1, or add --insecure"
        )
    return run_hub(HubLaunch(listen=[checked_endpoint(endpoint, "endpoint")]))


def endpoints_of(service: str, spec: ServiceSpec, connect: tuple[str, ...]) -> dict[str, str]:
    """Side → endpoint, the service's home first.

    Raises:
        LindyError: not SIDE=ENDPOINT, an unknown side, or one is missing.
    """
    given: dict[str, str] = {}
    for text in connect:
        side, equals, endpoint = text.partition("=")
        if not equals or not endpoint:
            raise LindyError(f"--connect {text}: expected SIDE=ENDPOINT")
        if side not in spec.sides:
            raise LindyError(f"--connect {text}: unknown side{nearest(side, spec.sides)}")
        given[side] = checked_endpoint(endpoint, f"--connect {side} =")
    if missing := [side for side in spec.sides if side not in given]:
        example = f"--connect {missing[0]}=tcp/127.0.0.1:7447"
        raise LindyError(f"{service} needs a hub for {' and '.join(spec.sides)}; add {example}")
    return {side: given[side] for side in spec.sides}
