"""Where in the network's keys a drone is: its namespace, and the sign that it is there. Pure.

Every drone's streams are below `lindy/@v1/<its name>`. As long as a hub runs, it holds the
liveliness token `lindy/@v1/<name>/here/<side>/<instance>`. A token is a key without content: what
else there is to know of a drone is in its rows `identity/drone`, `vehicle/status` and
`sensor/battery`. A token goes when its hub ends, is killed, or is cut off.
"""

import re
from typing import NamedTuple

from services.runtime.config.errors import LindyError

VERSION = "@v1"  # a verbatim chunk of the key: incompatible versions do not see each other
LONGEST = 55  # [letters] of a name: with `observer:` before it, the longest name in a certificate
MAY_HAVE = (
    f"letters without accents, digits, '-', '_' and '.' only, 1 to {LONGEST} of them; a name has a "
    f"letter or digit"
)
# With a letter or digit: `.` and `..` are folders where recordings and keys are kept by name.
NAME = re.compile(rf"(?=[_.-]*[A-Za-z0-9])[A-Za-z0-9_.-]{{1,{LONGEST}}}")
TOKEN = re.compile(rf"lindy/{VERSION}/([^/]*)/here/(drone|topside)/([0-9a-f]{{1,16}})")


class Here(NamedTuple):
    """A hub that is there."""

    name: str  # of the drone
    side: str
    instance: str  # of its start: two drones of one name differ in it


def namespace(name: str) -> str:
    """Of the drone of this name; `*`: of every one."""
    return f"lindy/{VERSION}/{name}"


EVERY_SPACE = namespace("*")


def here_key(space: str, side: str = "*", instance: str = "*") -> str:
    """Of a token; with `*` what is asked for to hear of all."""
    return f"{space}/here/{side}/{instance}"


def here_of(key: str) -> Here | None:
    """The hub that a token is of; None: a stranger's token, of a form or name that none has."""
    found = TOKEN.fullmatch(key)
    if found is None or NAME.fullmatch(found[1]) is None:
        return None
    return Here(*found.groups())


def name_in(key: str) -> str:
    """The drone's name in a key of the network; empty: it is in none's namespace."""
    chunks = key.split("/", 3)
    found = chunks[2] if len(chunks) == 4 and chunks[:2] == ["lindy", VERSION] else ""
    return found if NAME.fullmatch(found) else ""


def checked_name(name: str, option: str) -> str:
    """Raises LindyError: a drone cannot be called this."""
    if NAME.fullmatch(name) is None:
        raise LindyError(
            f"{option} {name[: 2 * LONGEST]!r}: a drone's name is a part of every key, so it may "
            f"have {MAY_HAVE}"
        )
    return name


MOST = 65535  # the highest port
EXAMPLE = "tcp/127.0.0.1:7447"
# Only protocols to which access control gives rights: by others a hub would hear nobody.
# Of Zenoh's options behind an address only the network interface: others could switch keys off.
ENDPOINT = re.compile(
    r"(tcp|udp|tls|quic)/(\[[^\]/\s]+\]|[^:/?#\s]+):(?P<port>[0-9]+)(#iface=[\w.-]+)?"
    r"|unixsock-stream/[^?#]+"
)


def checked_endpoint(text: str, option: str) -> str:
    """Raises LindyError: this is no endpoint, or there is no such port."""
    found = ENDPOINT.fullmatch(text)
    if found is None:
        raise LindyError(
            f"{option} {text!r}: expected PROTOCOL/ADDRESS:PORT with tcp, tls, quic or udp, such "
            f"as {EXAMPLE}"
        )
    port = found["port"]
    if port is not None and (len(port) > len(str(MOST)) or not 1 <= int(port) <= MOST):
        raise LindyError(f"{option} {text!r}: no such port, expected one of 1 to {MOST}")
    return text
