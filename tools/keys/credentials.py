"""Who a certificate says somebody is, a role and a name; which endpoints need keys, and the keys
for them."""

import ipaddress
from collections.abc import Collection
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Literal, NamedTuple, get_args

from services.runtime.bus.access_control import Credentials
from services.runtime.bus.spaces import LONGEST, MAY_HAVE, NAME, checked_endpoint
from services.runtime.config.errors import LindyError
from tools.packages import require_package

Role = Literal["drone", "pilot", "observer", "router"]
ROLES: tuple[Role, ...] = get_args(Role)
LETS_IN: dict[Role, tuple[Role, ...]] = {  # whom each role has a use for
    "drone": ("pilot", "observer", "router"),
    "pilot": ("drone", "router"),
    "observer": ("drone", "router"),
    "router": ("drone", "pilot", "observer", "router"),
}


class Identity(NamedTuple):
    """Written `pilot:ann`, which is also the common name in the certificate."""

    role: Role
    name: str

    def __str__(self) -> str:
        return f"{self.role}:{self.name}"

    @property
    def folder(self) -> str:
        """Name of the folder with the keys."""
        return f"{self.role}-{self.name}"


def parse(text: str) -> Identity:
    """Raises ValueError: not `role:name`, no such role, or not a name."""
    role, colon, name = text.partition(":")
    if not colon:
        raise ValueError(f"{text!r} is not ROLE:NAME, such as pilot:ann")
    if role not in ROLES:
        raise ValueError(f"unknown role {role!r}, expected {', '.join(ROLES)}")
    if NAME.fullmatch(name) is None:
        raise ValueError(f"{name[: 2 * LONGEST]!r} is no name: it may have {MAY_HAVE}")
    return Identity(role, name)


def parse_list(text: str) -> tuple[Identity, ...]:
    """The lines of a list of names; what follows a # is a remark.

    Raises:
        ValueError: a line that is not `role:name`, with its number.
    """
    found: list[Identity] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if word := line.partition("#")[0].strip():
            try:
                found.append(parse(word))
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
    return tuple(found)


def with_one(text: str, who: Identity) -> str:
    """The list with one name more, at its end; nothing else in it changes."""
    if who in parse_list(text):
        return text
    return f"{text}{'' if text.endswith(chr(10)) or not text else chr(10)}{who}\n"


def without(text: str, who: Identity) -> str:
    """The list without a name; nothing else in it changes."""
    parse_list(text)  # an error names the line of the whole list
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if parse_list(line) != (who,))


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
