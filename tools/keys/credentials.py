"""Which endpoints need keys, and the keys for them."""

import ipaddress
from collections.abc import Collection
from datetime import UTC, datetime, timedelta
from pathlib import Path

from services.runtime.bus.key_files import Credentials
from services.runtime.bus.spaces import checked_endpoint
from services.runtime.config.errors import LindyError
from tools.keys.roles import Role
from tools.packages import require_package

DEFAULT = "~/.config/lindy/keys"
CRYPTOGRAPHY = ("cryptography", "keys", "`lindy keys`")
SOON = timedelta(days=30)
OPEN = "INSECURE: whoever reaches this port can fly the drone"


def needs_keys(endpoint: str, option: str, *, insecure: bool) -> bool:
    """Do keys keep strangers out at an endpoint? Pure.

    On a loopback address or a file there are only users of this machine, and they are trusted.

    Raises:
        LindyError: it would be open to other machines, and nobody said that it may.
    """
    protocol, _, address = endpoint.partition("/")
    if protocol == "tls" and insecure:
        raise LindyError(f"--insecure with {option} {endpoint}: tls always has keys; use tcp")
    if protocol == "tls" or insecure or is_local(endpoint):
        return protocol == "tls"
    raise LindyError(
        f"{option} {endpoint} goes over the network without keys: make them with `lindy keys new` "
        f"and use tls/{address}, or add --insecure"
    )


def is_local(endpoint: str) -> bool:
    """Can only this machine reach it?"""
    protocol, _, address = endpoint.partition("/")
    if protocol == "unixsock-stream":
        return True
    host = address.partition("?")[0].partition("#")[0].rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def credentials(
    endpoint: str, option: str, roles: Collection[Role], keys: Path | None, *, insecure: bool
) -> Credentials | None:
    """What this machine needs for an endpoint; None: no keys are used there.

    Args:
        roles: one of which the keys must have.
        keys: folder with them.

    Raises:
        LindyError: not an endpoint, it needs keys, or the keys are no good.
    """
    if not needs_keys(checked_endpoint(endpoint, option), option, insecure=insecure):
        return None
    require_package(*CRYPTOGRAPHY)
    from tools.keys.authority import own_keys
    from tools.keys.certificates import day

    now = datetime.now(UTC)
    certificate, found = own_keys((keys or Path(DEFAULT)).expanduser(), roles, now)
    if certificate.ends - now < SOON:
        print(f"the certificate of {certificate.who} ends on {day(certificate.ends)}", flush=True)
    if not found.admitted:
        print(f"the list of {certificate.who} names nobody: nobody can connect", flush=True)
    return found
