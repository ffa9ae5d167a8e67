"""`lindy run` and `lindy hub`: one process of a stack in the foreground, to start it by hand."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from services.runtime.bus.access_control import KeyFiles
from services.runtime.bus.spaces import checked_endpoint
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.hosts.process_host import HubLaunch, Launch, run_hub, run_services
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from tools.checks import pilot_of
from tools.choices import SERVICE, ServiceChoices, named
from tools.keys.credentials import Role, credentials, is_local
from tools.live.cockpit import VIEWER, with_further_cameras
from tools.live.dive_folder import dive_files
from tools.replay.play import one_bus
from tools.start import settled

CALLERS: tuple[Role, ...] = ("observer", "pilot")
FILE = {"recorder": "mcap", "visualizer": "rrd"}  # of one dive only


def run(
    service: str,
    /,
    *,
    connect: Annotated[
        tuple[str, ...],
        Parameter(help="SIDE=ENDPOINT of a hub, once for each side of the service"),
    ] = (),
    keys: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="folder of the keys, for a hub at tls/…; default: ~/.config/lindy/keys",
        ),
    ] = None,
    replay: Annotated[
        bool,
        Parameter(help="visualizer: show what `lindy replay --listen` plays, and no vehicle"),
    ] = False,
    choices: ServiceChoices = SERVICE,
) -> int:
    """Run one service in the foreground, on running hubs.

    Example: lindy run control --connect drone=tcp/127.0.0.1:7448
    """
    services = with_further_cameras(Registry.read(choices.stack), choices)
    if service not in services:
        raise LindyError(f"unknown service {service!r}{nearest(service, sorted(services))}")
    spec = services[service]
    if replay:
        spec = of_a_replay(service, spec)
    endpoints = endpoints_of(service, spec, connect)
    folder = (choices.out or Path()).resolve()
    if (kind := FILE.get(service)) and (earlier := dive_files(folder, kind)):
        raise LindyError(f"{earlier[0]} is there already; choose another --out for the {service}")
    here = services.only({service: spec})
    pilot = pilot_of(choices.pilot or "gamepad")
    settings = settled(choices, pilot, services, here, out=str(folder), replay=replay)
    with tempfile.TemporaryDirectory(prefix="lindy-") as checkpoint:
        return run_services(
            Launch(
                process=service,
                services={service: spec},
                stack=settings,
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
            found = credentials(endpoint, f"--connect {side} =", CALLERS, keys, insecure=False)
            return None if found is None else found.keys
    return None


def hub(
    endpoint: str,
    /,
    *,
    insecure: Annotated[bool, Parameter(help="let in whoever reaches the endpoint")] = False,
) -> int:
    """Run a side's hub in the foreground.

    Example: lindy hub tcp/127.0.0.1:7448
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
