"""`lindy run` and `lindy hub`: one process of a stack in the foreground, for a stack by hand."""

import tempfile
from pathlib import Path

import msgspec

from services.runtime.endpoint import checked_endpoint
from services.runtime.errors import LindyError
from services.runtime.process_host import HubLaunch, Launch, run_hub, run_service
from services.runtime.settings import nearest
from services.runtime.stack import Row, services_of
from tools.checks import checked, pilot_of
from tools.choices import Choices
from tools.dive_folder import dive_files

FILE = {"recorder": "mcap", "visualizer": "rrd"}  # of one dive only


def run(service: str, connect: tuple[str, ...], choices: Choices) -> int:
    """One service until Ctrl-C. Returns its exit status.

    Raises:
        LindyError: an unknown service, or a realm that is missing or has no endpoint.
    """
    rows = services_of("dive")
    if service not in rows:
        raise LindyError(f"unknown service {service!r}{nearest(service, sorted(rows))}")
    row = rows[service]
    endpoints = endpoints_of(service, row, connect)
    stack = checked(choices, pilot_of(choices.pilot or "gamepad"))
    out = (choices.out or Path()).resolve()
    if (kind := FILE.get(service)) and (earlier := dive_files(out, kind)):
        raise LindyError(f"{earlier[0]} is there already; choose another --out for the {service}")
    stack = msgspec.structs.replace(stack, out=str(out))
    with tempfile.TemporaryDirectory(prefix="lindy-") as memory:
        return run_service(
            Launch(
                service=service,
                stack=stack,
                endpoints=endpoints,
                gateway=row.gateway,
                memory=memory,
            )
        )


def hub(endpoint: str) -> int:
    """A realm's hub until Ctrl-C. Returns its exit status."""
    return run_hub(HubLaunch(listen=[checked_endpoint(endpoint, "endpoint")]))


def endpoints_of(service: str, row: Row, connect: tuple[str, ...]) -> dict[str, str]:
    """Realm → endpoint, the service's home first.

    Raises:
        LindyError: not REALM=ENDPOINT, an unknown realm, or one is missing.
    """
    given: dict[str, str] = {}
    for text in connect:
        realm, equals, endpoint = text.partition("=")
        if not equals or not endpoint:
            raise LindyError(f"--connect {text}: expected REALM=ENDPOINT")
        if realm not in row.realms:
            raise LindyError(f"--connect {text}: unknown realm{nearest(realm, row.realms)}")
        given[realm] = checked_endpoint(endpoint, f"--connect {realm} =")
    if missing := [realm for realm in row.realms if realm not in given]:
        example = f"--connect {missing[0]}=tcp/127.0.0.1:7447"
        raise LindyError(f"{service} lives in {', '.join(row.realms)}; add {example}")
    return {realm: given[realm] for realm in row.realms}
